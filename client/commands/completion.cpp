#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/commands.h"

namespace remesh::client {
namespace {

struct Flag {
    std::vector<std::string> names{};  ///< With their dashes.
    std::string help{};
    std::vector<std::string> choices{};  ///< Words that it takes, if they are few.
    bool takes_value = false;
};

struct Command {
    std::string name{};  ///< Empty for the global options.
    std::string help{};
    std::vector<Flag> flags{};
};

/// "auto|off|on" -> its words.
std::vector<std::string> choices_of(const std::string& type) {
    std::vector<std::string> words;
    if (type.find('|') == std::string::npos) {
        return words;
    }
    for (std::size_t start = 0; start <= type.size();) {
        const std::size_t end = std::min(type.find('|', start), type.size());
        words.push_back(type.substr(start, end - start));
        start = end + 1;
    }
    return words;
}

Command command_of(const CLI::App& app, bool is_global) {
    Command command{is_global ? "" : app.get_name(), app.get_description(), {}};
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_positional()) {
            continue;
        }
        Flag flag{{}, option->get_description(), {}, option->get_type_size_max() > 0};
        for (const std::string& name : option->get_lnames()) {
            flag.names.push_back("--" + name);
        }
        for (const std::string& name : option->get_snames()) {
            flag.names.push_back("-" + name);
        }
        flag.choices = choices_of(option->get_type_name());
        command.flags.push_back(std::move(flag));
    }
    return command;
}

/// The global options first.
std::vector<Command> commands_of(const CLI::App& app) {
    std::vector<Command> commands{command_of(app, true)};
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
        commands.push_back(command_of(*sub, false));
    }
    return commands;
}

std::string words_of(const Command& command) {
    std::string words;
    for (const Flag& flag : command.flags) {
        words += fmt::format("{}{}", words.empty() ? "" : " ", fmt::join(flag.names, " "));
    }
    return words;
}

std::string names_of(const std::vector<Command>& commands, const std::string& between) {
    std::string names;
    for (const Command& command : commands) {
        if (!command.name.empty()) {
            names += (names.empty() ? "" : between) + command.name;
        }
    }
    return names;
}

std::string bash_script(const std::vector<Command>& commands) {
    std::string choices;
    std::string flags;
    for (const Command& command : commands) {
        for (const Flag& flag : command.flags) {
            if (!flag.choices.empty()) {
                choices += fmt::format(
                    "        {}) COMPREPLY=($(compgen -W \"{}\" -- \"$cur\")); return ;;\n",
                    fmt::join(flag.names, "|"), fmt::join(flag.choices, " "));
            }
        }
        if (!command.name.empty()) {
            flags +=
                fmt::format("            {}) words+=\" {}\" ;;\n", command.name, words_of(command));
        }
    }
    return fmt::format(R"(_remesh() {{
    local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} command= word words
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        case $word in {0}) command=$word; break ;; esac
    done
    COMPREPLY=()
    case $prev in
{1}    esac
    if [[ $cur == -* ]]; then
        words="{2}"
        case $command in
{3}        esac
        COMPREPLY=($(compgen -W "$words" -- "$cur"))
    elif [[ -z $command ]]; then
        COMPREPLY=($(compgen -W "{4}" -- "$cur"))
    else
        COMPREPLY=($(compgen -f -- "$cur"))
    fi
}}
complete -o filenames -F _remesh remesh
)",
                       names_of(commands, "|"), choices, words_of(commands.front()), flags,
                       names_of(commands, " "));
}

/// For single quotes of fish.
std::string quoted(const std::string& text) {
    std::string result = "'";
    for (const char c : text) {
        if (c == '\'' || c == '\\') {
            result += '\\';
        }
        result += c;
    }
    return result + "'";
}

std::string fish_script(const std::vector<Command>& commands) {
    std::string script;
    for (const Command& command : commands) {
        std::string condition;
        if (!command.name.empty()) {
            script += fmt::format("complete -c remesh -n __fish_use_subcommand -f -a {} -d {}\n",
                                  command.name, quoted(command.help));
            condition = fmt::format(" -n '__fish_seen_subcommand_from {}'", command.name);
        }
        for (const Flag& flag : command.flags) {
            script += "complete -c remesh" + condition;
            for (const std::string& name : flag.names) {
                script +=
                    name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
            }
            if (flag.takes_value) {
                script += flag.choices.empty()
                              ? " -r"
                              : fmt::format(" -x -a '{}'", fmt::join(flag.choices, " "));
            }
            script += " -d " + quoted(flag.help) + "\n";
        }
    }
    return script;
}

std::string script_for(const std::string& shell, const CLI::App& app) {
    const std::vector<Command> commands = commands_of(app);
    if (shell == "fish") {
        return fish_script(commands);
    }
    // zsh runs bash's completions by its own bridge.
    return (shell == "zsh" ? "autoload -Uz bashcompinit && bashcompinit\n" : "") +
           bash_script(commands);
}

}  // namespace

void add_completion(CLI::App& app, Action& chosen) {
    CLI::App* command =
        app.add_subcommand("completion", "Print a script that completes commands and options");
    const auto shell = std::make_shared<std::string>();
    command->add_option("SHELL", *shell, "bash, zsh or fish")
        ->type_name("bash|zsh|fish")
        ->required()
        ->check(CLI::IsMember({"bash", "zsh", "fish"}).description(""));
    command->callback([shell, &app, &chosen] {
        chosen = [shell, &app](Session&) {
            fmt::print("{}", script_for(*shell, app));
            return ExitCode::Ok;
        };
    });
    command->footer(
        "bash:  source <(remesh completion bash)\n"
        "zsh:   source <(remesh completion zsh)\n"
        "fish:  remesh completion fish > ~/.config/fish/completions/remesh.fish");
}

}  // namespace remesh::client
