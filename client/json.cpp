#include "client/json.h"

#include <google/protobuf/duration.pb.h>
#include <google/protobuf/timestamp.pb.h>
#include <google/protobuf/util/time_util.h>

#include <cctype>
#include <string_view>

namespace remesh::client {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using Json = nlohmann::ordered_json;

/// "Job.State" has values "STATE_...": the prefix is the enumeration's own name.
std::string value_word(const google::protobuf::EnumValueDescriptor& value) {
    std::string prefix;
    for (const char c : value.type()->name()) {
        if (std::isupper(static_cast<unsigned char>(c)) != 0 && !prefix.empty()) {
            prefix += '_';
        }
        prefix += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    }
    prefix += '_';
    return value.name().starts_with(prefix) ? value.name().substr(prefix.size()) : value.name();
}

/// Reads one value; `index` < 0 means the field isn't repeated.
class FieldReader {
public:
    FieldReader(const Message& message, const FieldDescriptor& field, int index)
        : message_(message), field_(field), index_(index), reflection_(*message.GetReflection()) {}

    [[nodiscard]] Json read() const {
        switch (field_.cpp_type()) {
            case FieldDescriptor::CPPTYPE_INT32:
                return get(&Reflection::GetInt32, &Reflection::GetRepeatedInt32);
            case FieldDescriptor::CPPTYPE_INT64:
                return get(&Reflection::GetInt64, &Reflection::GetRepeatedInt64);
            case FieldDescriptor::CPPTYPE_UINT32:
                return get(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32);
            case FieldDescriptor::CPPTYPE_UINT64:
                return get(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64);
            case FieldDescriptor::CPPTYPE_DOUBLE:
                return get(&Reflection::GetDouble, &Reflection::GetRepeatedDouble);
            case FieldDescriptor::CPPTYPE_FLOAT:
                return get(&Reflection::GetFloat, &Reflection::GetRepeatedFloat);
            case FieldDescriptor::CPPTYPE_BOOL:
                return get(&Reflection::GetBool, &Reflection::GetRepeatedBool);
            case FieldDescriptor::CPPTYPE_STRING:
                return get(&Reflection::GetString, &Reflection::GetRepeatedString);
            case FieldDescriptor::CPPTYPE_ENUM:
                return value_word(*get(&Reflection::GetEnum, &Reflection::GetRepeatedEnum));
            case FieldDescriptor::CPPTYPE_MESSAGE:
                return to_json(index_ < 0
                                   ? reflection_.GetMessage(message_, &field_)
                                   : reflection_.GetRepeatedMessage(message_, &field_, index_));
        }
        return nullptr;
    }

private:
    template <typename Value>
    Value get(Value (Reflection::*single)(const Message&, const FieldDescriptor*) const,
              Value (Reflection::*repeated)(const Message&, const FieldDescriptor*, int)
                  const) const {
        return index_ < 0 ? (reflection_.*single)(message_, &field_)
                          : (reflection_.*repeated)(message_, &field_, index_);
    }

    const Message& message_;
    const FieldDescriptor& field_;
    int index_;
    const Reflection& reflection_;
};

Json repeated_to_json(const Message& message, const FieldDescriptor& field) {
    const Reflection& reflection = *message.GetReflection();
    Json values = field.is_map() ? Json::object() : Json::array();
    for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
        Json value = FieldReader(message, field, i).read();
        if (field.is_map()) {
            values[value["key"].get<std::string>()] = std::move(value["value"]);
        } else {
            values.push_back(std::move(value));
        }
    }
    return values;
}

}  // namespace

Json to_json(const Message& message) {
    if (const auto* time = dynamic_cast<const google::protobuf::Timestamp*>(&message)) {
        return google::protobuf::util::TimeUtil::ToString(*time);
    }
    if (const auto* duration = dynamic_cast<const google::protobuf::Duration*>(&message)) {
        return static_cast<double>(duration->seconds()) + 1e-9 * duration->nanos();
    }
    Json object = Json::object();
    const auto& descriptor = *message.GetDescriptor();
    for (int i = 0; i < descriptor.field_count(); ++i) {
        const FieldDescriptor& field = *descriptor.field(i);
        if (field.is_repeated()) {
            object[field.name()] = repeated_to_json(message, field);
        } else if (!field.has_presence() || message.GetReflection()->HasField(message, &field)) {
            object[field.name()] = FieldReader(message, field, -1).read();
        }
    }
    return object;
}

std::string json_line(const Message& message) {
    return to_json(message).dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace remesh::client
