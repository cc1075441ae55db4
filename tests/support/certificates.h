#pragma once

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>

namespace remesh::testing {

/// A key and the certificate for it, PEM.
struct Identity {
    std::string certificate{};
    std::string key{};
};

/// A certificate authority of a test, with elliptic curves for speed.
class Authority {
public:
    Authority() : key_(EVP_EC_gen("P-256")), certificate_(unsigned_certificate(key_.get(), "ca")) {
        X509_set_issuer_name(certificate_.get(), X509_get_subject_name(certificate_.get()));
        add_extension(certificate_.get(), NID_basic_constraints, "critical,CA:TRUE");
        X509_sign(certificate_.get(), key_.get(), EVP_sha256());
    }

    /// What others trust, PEM.
    [[nodiscard]] std::string certificate() const {
        return pem([&](BIO* out) { PEM_write_bio_X509(out, certificate_.get()); });
    }
    /// \param names  of its subject, e.g. "IP:127.0.0.1" or "DNS:pipeline"
    [[nodiscard]] Identity issue(const std::string& names,
                                 std::chrono::system_clock::time_point end = in_a_month()) const {
        const Key key(EVP_EC_gen("P-256"));
        const Certificate certificate = unsigned_certificate(key.get(), "test");
        ASN1_TIME_set(X509_getm_notAfter(certificate.get()),
                      std::chrono::system_clock::to_time_t(end));
        X509_set_issuer_name(certificate.get(), X509_get_subject_name(certificate_.get()));
        add_extension(certificate.get(), NID_subject_alt_name, names);
        X509_sign(certificate.get(), key_.get(), EVP_sha256());
        return {pem([&](BIO* out) { PEM_write_bio_X509(out, certificate.get()); }),
                pem([&](BIO* out) {
                    PEM_write_bio_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
                })};
    }

private:
    template <auto Function>
    struct FreeWith {
        template <typename T>
        void operator()(T* object) const {
            Function(object);
        }
    };
    using Key = std::unique_ptr<EVP_PKEY, FreeWith<EVP_PKEY_free>>;
    using Certificate = std::unique_ptr<X509, FreeWith<X509_free>>;

    static std::chrono::system_clock::time_point in_a_month() {
        return std::chrono::system_clock::now() + std::chrono::days(30);
    }
    static Certificate unsigned_certificate(EVP_PKEY* key, const char* name) {
        static long serial = 0;
        Certificate certificate(X509_new());
        X509_set_version(certificate.get(), 2);
        ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), ++serial);
        X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -3600);
        ASN1_TIME_set(X509_getm_notAfter(certificate.get()),
                      std::chrono::system_clock::to_time_t(in_a_month()));
        X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate.get()), "CN", MBSTRING_UTF8,
                                   reinterpret_cast<const unsigned char*>(name), -1, -1, 0);
        X509_set_pubkey(certificate.get(), key);
        return certificate;
    }
    static void add_extension(X509* certificate, int kind, const std::string& value) {
        X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, nullptr, kind, value.c_str());
        if (extension == nullptr) {
            throw std::runtime_error("can't make the extension " + value);
        }
        X509_add_ext(certificate, extension, -1);
        X509_EXTENSION_free(extension);
    }
    template <typename Write>
    static std::string pem(Write write) {
        const std::unique_ptr<BIO, FreeWith<BIO_free_all>> memory(BIO_new(BIO_s_mem()));
        write(memory.get());
        char* data = nullptr;
        const long size = BIO_get_mem_data(memory.get(), &data);
        return {data, static_cast<std::size_t>(size)};
    }

    Key key_;
    Certificate certificate_;
};

}  // namespace remesh::testing
