#include "client/formats.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/failure.h"
#include "client/text.h"

namespace remesh::client {
namespace {

bool can_write(const v1::FormatCapability& format) {
    return format.can_write_surface() || format.can_write_tetrahedra();
}

}  // namespace

v1::Format format_named(const std::string& word) {
    std::vector<std::string> words;
    const auto& values = *v1::Format_descriptor();
    for (int i = 1; i < values.value_count(); ++i) {
        const auto format = static_cast<v1::Format>(values.value(i)->number());
        words.push_back(format_word(format));
        if (words.back() == lower_case(word)) {
            return format;
        }
    }
    throw Failure(ExitCode::Usage, fmt::format("no format is called {}; there are {}",
                                               sanitised(word), fmt::join(words, ", ")));
}

v1::Format format_for(const std::filesystem::path& path,
                      const v1::GetCapabilitiesResponse& server) {
    const std::string extension = lower_case(path.extension().string());
    std::vector<std::string> known;
    for (const auto& format : server.formats()) {
        if (!can_write(format)) {
            continue;
        }
        if (lower_case(format.extension()) == extension) {
            return format.format();
        }
        const std::string safe = sanitised(format.extension());
        if (std::find(known.begin(), known.end(), safe) == known.end()) {
            known.push_back(safe);
        }
    }
    throw Failure(ExitCode::Usage,
                  fmt::format("can't tell the format of {} from its name; the server writes {} "
                              "(or say --format)",
                              sanitised(path.string()), fmt::join(known, " ")));
}

std::string extension_of(v1::Format format, const v1::GetCapabilitiesResponse& server) {
    for (const auto& known : server.formats()) {
        if (known.format() == format) {
            return sanitised(known.extension());
        }
    }
    return "." + format_word(format);
}

std::vector<v1::Format> wanted_formats(const std::vector<std::string>& words,
                                       const v1::Options& options) {
    std::vector<v1::Format> formats;
    for (const std::string& word : words) {
        formats.push_back(format_named(word));
    }
    if (formats.empty()) {
        const bool is_surface_only = options.has_tetrahedra() && !options.tetrahedra();
        if (!is_surface_only) {
            formats.push_back(v1::FORMAT_VTU);
        }
        formats.push_back(v1::FORMAT_PLY);
    }
    return formats;
}

std::string stem_of(const std::filesystem::path& input) {
    if (input == "-") {
        return "stdin";
    }
    std::filesystem::path name = input.filename();
    if (lower_case(name.extension().string()) == ".gz") {
        name = name.stem();
    }
    return name.stem().string();
}

}  // namespace remesh::client
