#pragma once

#include <CLI/CLI.hpp>

#include <map>
#include <string>

namespace remesh::client {

/// An option with a value; `set` is called only if it is given.
template <typename Value, typename Setter>
CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& type,
                       const std::string& help, Setter set) {
    return command
        .add_option_function<Value>(
            name, [set](const Value& value) { set(value); }, help)
        ->type_name(type);
}

/// An option with a fixed set of words.
template <typename Enum, typename Setter>
void add_choice(CLI::App& command, const std::string& name,
                const std::map<std::string, Enum>& words, const std::string& help, Setter set) {
    std::string type;
    for (const auto& [word, value] : words) {
        type += (type.empty() ? "" : "|") + word;
    }
    command
        .add_option_function<std::string>(
            name, [set, words](const std::string& word) { set(words.at(word)); }, help)
        ->type_name(type)
        ->check(CLI::IsMember(words).description(""));
}

}  // namespace remesh::client
