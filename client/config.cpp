#include "client/config.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace remesh::client {
namespace {

/// CLI11 takes a file's word over the environment's, so what the environment sets is left out.
class EnvironmentFirst final : public CLI::ConfigTOML {
public:
    explicit EnvironmentFirst(const CLI::App& app) : app_(app) {}

    std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
        std::vector<CLI::ConfigItem> found = CLI::ConfigTOML::from_config(input);
        std::erase_if(found, [this](const CLI::ConfigItem& item) {
            const CLI::Option* option =
                item.parents.empty() ? app_.get_option_no_throw("--" + item.name) : nullptr;
            return option != nullptr && !option->get_envname().empty() &&
                   std::getenv(option->get_envname().c_str()) != nullptr;
        });
        return found;
    }

private:
    const CLI::App& app_;
};

std::string default_file() {
    const char* config = std::getenv("XDG_CONFIG_HOME");
    const char* home = std::getenv("HOME");
    std::filesystem::path folder;
    if (config != nullptr && *config != '\0') {
        folder = config;
    } else if (home != nullptr && *home != '\0') {
        folder = std::filesystem::path(home) / ".config";
    }
    return folder.empty() ? "" : folder / "remesh" / "config.toml";
}

}  // namespace

void add_config(CLI::App& app) {
    app.set_config("--config", default_file(), "Global options, one a line: server = \"HOST:PORT\"")
        ->type_name("FILE");
    app.config_formatter(std::make_shared<EnvironmentFirst>(app));
    app.allow_config_extras(CLI::config_extras_mode::error);
}

}  // namespace remesh::client
