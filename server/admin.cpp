#include "server/admin.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <unistd.h>

#include "server/auth/access_store.h"
#include "server/auth/audit_log.h"
#include "server/store/data_dir.h"
#include "server/store/sqlite_job_store.h"

namespace remesh {
namespace {

struct AdminFlags {
    std::string data_dir{};
    std::string tenant{};
    std::string role = "user";
    std::string note{};
    std::string name{};
    int days = 0;  ///< 0: for ever.
    std::string head{};
    std::optional<int> weight{};
    std::string max_running{};  ///< A number, "default", or empty: as it is.
    std::string max_queued{};
    std::string max_bytes{};
};

std::string text_of(Time time) {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                       std::chrono::time_point_cast<std::chrono::seconds>(time));
}

CredentialRequest request_of(const AdminFlags& flags) {
    CredentialRequest request{flags.tenant, role_named(flags.role), flags.note, {}};
    if (flags.days > 0) {
        request.expire_time = system_now() + std::chrono::days(flags.days);
    }
    return request;
}

void record(const AdminFlags& flags, const std::string& action, const Credential& credential) {
    AuditLog(flags.data_dir)
        .append({system_now(), credential.tenant, "operator:" + std::to_string(::getuid()), "",
                 action, credential.id, "OK"});
}

int create_token(const AdminFlags& flags) {
    const IssuedToken issued =
        AccessStore(flags.data_dir).create_token(request_of(flags), system_now());
    record(flags, "CreateToken", issued.credential);
    fmt::print(stderr, "token {} for tenant {}, role {}; it is shown this once:\n",
               issued.credential.id, issued.credential.tenant, role_name(issued.credential.role));
    fmt::print("{}\n", issued.token);
    return EXIT_SUCCESS;
}

int allow_certificate(const AdminFlags& flags) {
    const Credential credential =
        AccessStore(flags.data_dir).allow_certificate(flags.name, request_of(flags), system_now());
    record(flags, "AllowCertificate", credential);
    fmt::print("{}\n", credential.id);
    return EXIT_SUCCESS;
}

int list(const AdminFlags& flags, Credential::Kind kind) {
    for (const Credential& credential : AccessStore(flags.data_dir).list()) {
        if (credential.kind != kind) {
            continue;
        }
        nlohmann::ordered_json line{{"id", credential.id},
                                    {"tenant", credential.tenant},
                                    {"role", role_name(credential.role)},
                                    {"note", credential.note},
                                    {"create_time", text_of(credential.create_time)}};
        if (kind == Credential::Kind::Certificate) {
            line["name"] = credential.certificate_name;
        }
        if (credential.expire_time) {
            line["expire_time"] = text_of(*credential.expire_time);
        }
        if (credential.revoke_time) {
            line["revoke_time"] = text_of(*credential.revoke_time);
        }
        fmt::print("{}\n", line.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace));
    }
    return EXIT_SUCCESS;
}

int revoke(const AdminFlags& flags) {
    const auto credential = AccessStore(flags.data_dir).revoke(flags.name, system_now());
    if (!credential) {
        throw std::runtime_error("no valid credential has the id " + flags.name);
    }
    record(flags, "RevokeCredential", *credential);
    return EXIT_SUCCESS;
}

int print_audit(const AdminFlags& flags) {
    AuditLog(flags.data_dir).for_each([](const AuditRecord& record) {
        const nlohmann::ordered_json line{{"sequence", record.sequence},
                                          {"time", text_of(record.entry.time)},
                                          {"tenant", record.entry.tenant},
                                          {"actor", record.entry.actor},
                                          {"peer", record.entry.peer},
                                          {"action", record.entry.action},
                                          {"subject", record.entry.subject},
                                          {"outcome", record.entry.outcome},
                                          {"hash", record.hash}};
        fmt::print("{}\n", line.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace));
    });
    return EXIT_SUCCESS;
}

int verify_audit(const AdminFlags& flags) {
    const auto colon = flags.head.find(':');
    const bool is_known = colon != std::string::npos;
    const AuditVerdict verdict = is_known ? AuditLog(flags.data_dir)
                                                .verify(std::stoll(flags.head.substr(0, colon)),
                                                        flags.head.substr(colon + 1))
                                          : AuditLog(flags.data_dir).verify();
    if (!verdict.trouble.empty()) {
        throw std::runtime_error("the audit log was tampered with: " + verdict.trouble);
    }
    fmt::print("{}:{}\n", verdict.entries, verdict.head);
    return EXIT_SUCCESS;
}

/// The jobs' store of a server that was started once.
std::unique_ptr<JobStore> open_jobs(const AdminFlags& flags) {
    const std::filesystem::path file = std::filesystem::path(flags.data_dir) / "remesh.sqlite";
    if (!std::filesystem::exists(file)) {
        throw std::runtime_error("no server has used " + flags.data_dir + " yet");
    }
    prepare_data_dir(flags.data_dir);
    return open_sqlite_store(file);
}

void print_policy(JobStore& store, const std::string& tenant) {
    const TenantPolicy policy = store.policy(tenant);
    nlohmann::ordered_json line{{"tenant", tenant}, {"weight", policy.weight}};
    const auto add = [&](const char* name, const std::optional<std::int64_t>& limit) {
        if (limit) {
            line[name] = *limit;
        }
    };
    add("max_running", policy.max_running);
    add("max_queued", policy.max_queued);
    add("max_bytes", policy.max_bytes);
    line["stored_bytes"] = store.stored_bytes(tenant);
    fmt::print("{}\n", line.dump());
}

int show_tenant(const AdminFlags& flags) {
    print_policy(*open_jobs(flags), flags.tenant);
    return EXIT_SUCCESS;
}

int set_tenant(const AdminFlags& flags) {
    const auto store = open_jobs(flags);
    TenantPolicy policy = store->policy(flags.tenant);
    policy.weight = flags.weight.value_or(policy.weight);
    const auto set = [](std::optional<std::int64_t>& limit, const std::string& word) {
        if (word == "default") {
            limit.reset();
        } else if (!word.empty()) {
            limit = std::stoll(word);
        }
    };
    set(policy.max_running, flags.max_running);
    set(policy.max_queued, flags.max_queued);
    set(policy.max_bytes, flags.max_bytes);
    store->set_policy(flags.tenant, policy);
    AuditLog(flags.data_dir)
        .append({system_now(), flags.tenant, "operator:" + std::to_string(::getuid()), "",
                 "SetTenant", flags.tenant, "OK"});
    print_policy(*store, flags.tenant);
    return EXIT_SUCCESS;
}

CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& help,
                      const std::shared_ptr<AdminFlags>& flags, std::function<int()>& chosen,
                      std::function<int(const AdminFlags&)> action) {
    CLI::App* command = parent.add_subcommand(name, help);
    command->add_option("--data-dir", flags->data_dir, "Of the server")
        ->required()
        ->check(CLI::ExistingDirectory)
        ->envname("REMESHD_DATA_DIR");
    command->callback([flags, action = std::move(action), &chosen] {
        chosen = [flags, action] { return action(*flags); };
    });
    return command;
}

void add_grant_flags(CLI::App& command, AdminFlags& flags) {
    command.add_option("--tenant", flags.tenant, "Whose jobs and artifacts it gives access to")
        ->required();
    command.add_option("--role", flags.role, "viewer, user or operator")
        ->check(CLI::IsMember({"viewer", "user", "operator"}))
        ->capture_default_str();
    command.add_option("--note", flags.note, "For the list; never patient data");
    command.add_option("--days", flags.days, "How long it's valid; absent: until it's revoked")
        ->check(CLI::Range(1, 36'500));
}

void add_limit(CLI::App& command, const std::string& name, std::string& word,
               const std::string& help) {
    command.add_option(name, word, help)
        ->type_name("N|default")
        ->check([](const std::string& text) {
            const bool is_number = !text.empty() && text.size() <= 15 &&
                                   text.find_first_not_of("0123456789") == std::string::npos;
            return is_number || text == "default" ? std::string()
                                                  : "must be a number >= 0 or default, got " + text;
        });
}

void add_tenant(CLI::App& admin, const std::shared_ptr<AdminFlags>& flags,
                std::function<int()>& chosen) {
    CLI::App* tenant = admin.add_subcommand("tenant", "What a tenant may use");
    tenant->require_subcommand(1);
    const auto add_name = [&](CLI::App& command) {
        command.add_option("TENANT", flags->tenant)->required()->check([](const std::string& name) {
            return is_name(name)
                       ? std::string()
                       : "must have 1 to 64 lower-case letters, digits and hyphens, got " + name;
        });
    };
    add_name(*add_command(*tenant, "show", "Print its share, limits and bytes as JSON", flags,
                          chosen, show_tenant));
    CLI::App* set = add_command(*tenant, "set", "Change its share or limits, at once", flags,
                                chosen, set_tenant);
    add_name(*set);
    set->add_option("--weight", flags->weight,
                    "Its share of the workers against others', 1 at first")
        ->check(CLI::Range(1, 1000));
    add_limit(*set, "--max-running", flags->max_running, "Jobs that run side by side");
    add_limit(*set, "--max-queued", flags->max_queued, "Jobs that may wait");
    add_limit(*set, "--max-bytes", flags->max_bytes, "Bytes that it may keep, inputs and results");
}

}  // namespace

void add_admin(CLI::App& app, std::function<int()>& chosen) {
    const auto flags = std::make_shared<AdminFlags>();
    CLI::App* admin =
        app.add_subcommand("admin", "Manage tokens, certificates, tenants and the audit log");
    admin->require_subcommand(1);

    CLI::App* token = admin->add_subcommand("token", "Bearer tokens");
    token->require_subcommand(1);
    add_grant_flags(*add_command(*token, "create", "Make a token and print it this once", flags,
                                 chosen, create_token),
                    *flags);
    add_command(*token, "list", "List tokens, one JSON object a line", flags, chosen,
                [](const AdminFlags& f) { return list(f, Credential::Kind::Token); });
    add_command(*token, "revoke", "End a token's validity now", flags, chosen, revoke)
        ->add_option("ID", flags->name, "As create and list print it")
        ->required();

    CLI::App* certificate =
        admin->add_subcommand("certificate", "Names in client certificates that are let in");
    certificate->require_subcommand(1);
    CLI::App* allow =
        add_command(*certificate, "allow", "Let in certificates of the client authority for a name",
                    flags, chosen, allow_certificate);
    allow->add_option("NAME", flags->name, "Subject alternative name, or common name without any")
        ->required();
    add_grant_flags(*allow, *flags);
    add_command(*certificate, "list", "List names, one JSON object a line", flags, chosen,
                [](const AdminFlags& f) { return list(f, Credential::Kind::Certificate); });
    add_command(*certificate, "revoke", "Stop letting a name in", flags, chosen, revoke)
        ->add_option("ID", flags->name, "As allow and list print it")
        ->required();

    add_tenant(*admin, flags, chosen);

    CLI::App* audit = admin->add_subcommand("audit", "The log of who did what");
    audit->require_subcommand(1);
    add_command(*audit, "list", "Print the log, one JSON object a line", flags, chosen,
                print_audit);
    add_command(*audit, "verify", "Check the whole chain and print its head, SEQUENCE:HASH", flags,
                chosen, verify_audit)
        ->add_option("--head", flags->head,
                     "A head that was printed before: tells if the end was cut off or written anew")
        ->check([](const std::string& head) {
            const auto colon = head.find(':');
            const bool is_head = colon != std::string::npos && colon > 0 && colon < 19 &&
                                 head.find_first_not_of("0123456789") == colon;
            return is_head ? std::string() : "must be SEQUENCE:HASH, got " + head;
        });
}

}  // namespace remesh
