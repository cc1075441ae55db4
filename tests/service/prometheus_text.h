#pragma once

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>

namespace remesh::testing {

/// What a scrape says: samples by name and labels as they are written, and types by family. A
/// strict reader of Prometheus' text format 0.0.4.
/// \throws std::runtime_error with the first line that breaks the format
class PrometheusText {
public:
    explicit PrometheusText(const std::string& text) {
        std::istringstream lines(text);
        for (std::string line; std::getline(lines, line);) {
            read(line);
        }
    }

    [[nodiscard]] std::optional<double> value(const std::string& series) const {
        const auto found = samples_.find(series);
        return found == samples_.end() ? std::nullopt : std::optional(found->second);
    }
    [[nodiscard]] const std::map<std::string, double>& samples() const { return samples_; }
    [[nodiscard]] const std::map<std::string, std::string>& types() const { return types_; }

private:
    static bool is_name(const std::string& text) {
        return !text.empty() && std::isdigit(static_cast<unsigned char>(text[0])) == 0 &&
               std::all_of(text.begin(), text.end(), [](char c) {
                   return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == ':';
               });
    }

    void read(const std::string& line) {
        const auto refuse = [&] { throw std::runtime_error("not Prometheus text: " + line); };
        if (line.empty()) {
            return;
        }
        if (line[0] == '#') {
            std::istringstream words(line);
            std::string hash;
            std::string keyword;
            std::string name;
            std::string rest;
            words >> hash >> keyword >> name >> rest;
            if (keyword == "TYPE") {
                const std::set<std::string> known{"counter", "gauge", "histogram", "summary"};
                if (!is_name(name) || !known.contains(rest) || !types_.emplace(name, rest).second) {
                    refuse();
                }
            }
            return;
        }
        const auto space = line.rfind(' ');
        if (space == std::string::npos) {
            refuse();
        }
        const std::string series = line.substr(0, space);
        const std::string name = series.substr(0, series.find('{'));
        std::size_t end = 0;
        const double value = std::stod(line.substr(space + 1), &end);
        const bool has_labels = name.size() < series.size();
        if (!is_name(name) || end != line.size() - space - 1 ||
            (has_labels && series.back() != '}') || !samples_.emplace(series, value).second) {
            refuse();
        }
    }

    std::map<std::string, double> samples_;
    std::map<std::string, std::string> types_;
};

}  // namespace remesh::testing
