#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <algorithm>

#include "server/convert.h"

namespace remesh {

std::vector<OptionRow> option_rows(const RemeshOptions& options) {
    google::protobuf::util::JsonPrintOptions print;
    print.preserve_proto_field_names = true;
    print.always_print_primitive_fields = true;
    std::string text;
    const auto status =
        google::protobuf::util::MessageToJsonString(to_proto(options), &text, print);
    std::vector<OptionRow> rows;
    if (status.ok()) {
        const auto tree = nlohmann::ordered_json::parse(text).flatten();
        for (const auto& [path, value] : tree.items()) {
            std::string name = path.substr(1);
            std::replace(name.begin(), name.end(), '/', '.');
            rows.push_back({name, value.is_string() ? value.get<std::string>() : value.dump()});
        }
    }
    return rows;
}

}  // namespace remesh
