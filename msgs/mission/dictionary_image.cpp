// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "msgs/mission/dictionary_image.hpp"

#include <string_view>
#include <type_traits>

#include "msgs/mission/dictionary_parts.hpp"

namespace srfs::mission {
namespace {

template <class T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;

class Writer {
 public:
  template <class... Parts>
  void operator()(Parts&... parts) {
    (put(parts), ...);
  }
  [[nodiscard]] Octets take() { return out_.take(); }

 private:
  template <Number T>
  void put(T value) {
    if constexpr (std::is_floating_point_v<T>)
      out_.f64(value);
    else
      out_.put(static_cast<std::uint64_t>(value), sizeof value);
  }
  void put_text(std::string_view text) {
    put(text.size());
    out_.bytes({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  }
  void put(const std::string& text) { put_text(text); }
  void put(std::string& text) { put_text(text); }
  void put(milliseconds& time) { put(time.count()); }
  void put(const Enumeration* enumeration) { put_text(enumeration == nullptr ? "" : enumeration->name); }
  template <class T>
  void put(std::vector<T>& list) {
    put(list.size());
    for (T& each : list) put(each);
  }
  template <class Key, class T, class Less>
  void put(std::map<Key, T, Less>& map) {
    put(map.size());
    for (auto& [key, value] : map) (*this)(key, value);
  }
  template <class T>
  void put(std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  template <class T>
  requires std::is_class_v<T>
  void put(T& parts) { visit(*this, parts); }

  OctetWriter out_{std::size_t{16} << 20};
};

/// Reads what Writer wrote. Past the end everything is empty, and is_complete() false.
class Reader {
 public:
  Reader(OctetView image, const DictionaryParts& dictionary) : in_(image), enums_(dictionary.enums) {}

  template <class... Parts>
  void operator()(Parts&... parts) {
    (take(parts), ...);
  }
  [[nodiscard]] bool is_complete() const { return in_.ok() && good_ && in_.remaining() == 0; }

 private:
  template <Number T>
  void take(T& value) {
    if constexpr (std::is_floating_point_v<T>)
      value = static_cast<T>(in_.f64());
    else
      value = static_cast<T>(in_.get(sizeof value));
  }
  /// Of what follows; no element is shorter than one octet.
  std::size_t take_size() {
    std::size_t size = 0;
    take(size);
    good_ = good_ && size <= in_.remaining();
    return good_ ? size : 0;
  }
  void take(std::string& text) {
    const OctetView octets = in_.bytes(take_size());
    text.assign(octets.begin(), octets.end());
  }
  void take(milliseconds& time) {
    milliseconds::rep count = 0;
    take(count);
    time = milliseconds(count);
  }
  void take(const Enumeration*& enumeration) {
    std::string name;
    take(name);
    const auto found = enums_.find(name);
    enumeration = found == enums_.end() ? nullptr : &found->second;
    good_ = good_ && (name.empty() || enumeration != nullptr);
  }
  template <class T>
  void take(std::vector<T>& list) {
    list.resize(take_size());
    for (T& each : list) take(each);
  }
  template <class Key, class T, class Less>
  void take(std::map<Key, T, Less>& map) {
    for (std::size_t left = take_size(); left > 0 && good_; --left) {
      Key key{};
      take(key);
      take(map[key]);
    }
  }
  template <class T>
  void take(std::optional<T>& value) {
    bool there = false;
    take(there);
    if (there) take(value.emplace());
  }
  template <class T>
  requires std::is_class_v<T>
  void take(T& parts) { visit(*this, parts); }

  OctetReader in_;
  const std::map<std::string, Enumeration, std::less<>>& enums_;
  bool good_ = true;
};

// The bindings make a new member a compile error here.
template <class Archive>
void visit(Archive& archive, Bounds& bounds) {
  auto& [low, high] = bounds;
  archive(low, high);
}
template <class Archive>
void visit(Archive& archive, Enumeration& enumeration) {
  auto& [name, description, labels] = enumeration;
  archive(name, description, labels);
}
template <class Archive>
void visit(Archive& archive, Field& field) {
  auto& [name, type, unit, description, count, labels, max_text, hex, enumeration, reference, calibration,
         unknown, soft, hard, range, default_text, has_default] = field;
  archive(name, type, unit, description, count, labels, max_text, hex, enumeration, reference, calibration,
          unknown, soft, hard, range, default_text, has_default);
}
template <class Archive>
void visit(Archive& archive, ApplicationProcess& process) {
  auto& [name, apid, node, description, added] = process;
  archive(name, apid, node, description, added);
}
template <class Archive>
void visit(Archive& archive, FailureCode& failure) {
  auto& [code, name, text, parameter] = failure;
  archive(code, name, text, parameter);
}
template <class Archive>
void visit(Archive& archive, PacketStore& store) {
  auto& [id, name, quota_mib, services, description] = store;
  archive(id, name, quota_mib, services, description);
}
template <class Archive>
void visit(Archive& archive, Parameter& parameter) {
  auto& [id, name, node, node_parameter, field, list, guarded] = parameter;
  archive(id, name, node, node_parameter, field, list, guarded);
}
template <class Archive>
void visit(Archive& archive, Structure& structure) {
  auto& [name, kind, id, service, subtype, apid, node, interval, description, fields] = structure;
  archive(name, kind, id, service, subtype, apid, node, interval, description, fields);
}
template <class Archive>
void visit(Archive& archive, Event& event) {
  auto& [name, id, severity, text, fields] = event;
  archive(name, id, severity, text, fields);
}
template <class Archive>
void visit(Archive& archive, OrderedReports& reports) {
  auto& [service, subtype, structure, argument, several, may_be_none] = reports;
  archive(service, subtype, structure, argument, several, may_be_none);
}
template <class Archive>
void visit(Archive& archive, Command& command) {
  auto& [name, node, apid, service, subtype, function_id, peripheral_function, description, repeat_class,
         hazardous, recovery, repeated, min_groups, max_groups, head, modes, timeout, arguments, reports] =
      command;
  archive(name, node, apid, service, subtype, function_id, peripheral_function, description, repeat_class,
          hazardous, recovery, repeated, min_groups, max_groups, head, modes, timeout, arguments, reports);
}
template <class Archive>
void visit(Archive& archive, TelemetryPlace& place) {
  auto& [node, structure_id, offset] = place;
  archive(node, structure_id, offset);
}
template <class Archive>
void visit(Archive& archive, BeaconSource& source) {
  auto& [value, from, scale] = source;
  archive(value, from, scale);
}
template <class Archive>
void visit(Archive& archive, DictionaryParts& dictionary) {
  auto& [enums, spacecraft_id, apids, structures, commands, events, stores, failure_codes, parameters,
         payloads, beacon_sources, monitors, event_actions, attitude] = dictionary;
  archive(enums, spacecraft_id, apids, structures, commands, events, stores, failure_codes, parameters,
          payloads, beacon_sources, monitors, event_actions, attitude);
}

}  // namespace

Octets image_of(Dictionary& dictionary) {
  Writer writer;
  DictionaryParts parts = parts_of(dictionary);
  writer(parts);
  return writer.take();
}

std::optional<Dictionary> dictionary_of(OctetView image) {
  Dictionary dictionary = empty_dictionary();
  DictionaryParts parts = parts_of(dictionary);
  Reader reader(image, parts);
  reader(parts);
  if (!reader.is_complete()) return std::nullopt;
  return dictionary;
}

}  // namespace srfs::mission
