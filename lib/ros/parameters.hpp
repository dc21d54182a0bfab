#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <rcl_interfaces/msg/list_parameters_result.hpp>
#include <rcl_interfaces/msg/parameter_descriptor.hpp>
#include <rcl_interfaces/msg/parameter_value.hpp>

#include "base/config.hpp"
#include "base/result.hpp"

namespace srfs::ros {

using ParameterValue = std::variant<bool, std::int64_t, double, std::string, std::vector<bool>,
                                    std::vector<std::int64_t>, std::vector<double>, std::vector<std::string>>;

/// Inclusive bounds of an integer or floating-point parameter (every element of an array).
struct ParameterRange {
  double lowest = 0;
  double highest = 0;
};

struct ParameterDeclaration {
  ParameterValue default_value;  ///< its type is the parameter's type
  std::optional<ParameterRange> range;
  std::string description;
  bool read_only = false;
};

/// The parameters of one node: declared once with type, range and default, started from the deployment file's
/// values, changed at run time only after every rule and the node's own callback agreed. Pure: no DDS.
class ParameterSet {
 public:
  /// Refuses a change with a reason, for people. Called with the whole proposed set applied to nothing yet.
  using Check =
      std::function<Result<void, std::string>(const std::string& name, const ParameterValue& value)>;
  /// Called after the change holds.
  using Changed = std::function<void(const std::string& name)>;

  ParameterSet() = default;
  /// @param overrides the node's `parameters` mapping of the deployment file
  explicit ParameterSet(ConfigSection overrides) : overrides_(std::move(overrides)) {}

  /// Declares and returns the start value: the override, else the default. Throws ConfigError for an override
  /// of the wrong type or range.
  const ParameterValue& declare(const std::string& name, ParameterDeclaration declaration);
  /// Throws ConfigError for overrides that nobody declared. After all declarations.
  void finish() const;

  /// All or none. @return per parameter its refusal (empty: fine); all empty means all were applied
  [[nodiscard]] std::vector<std::string> set_atomically(
      const std::vector<std::pair<std::string, ParameterValue>>& changes);
  [[nodiscard]] const ParameterValue* find(const std::string& name) const;
  [[nodiscard]] const ParameterDeclaration* declaration(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> names() const;

  void set_check(Check check) { check_ = std::move(check); }
  void set_changed(Changed changed) { changed_ = std::move(changed); }

 private:
  struct Entry {
    ParameterDeclaration declaration;
    ParameterValue value;
  };
  [[nodiscard]] std::string refusal(const std::string& name, const ParameterValue& value) const;

  std::optional<ConfigSection> overrides_;
  std::map<std::string, Entry> entries_;
  Check check_;
  Changed changed_;
};

/// The value as ROS 2 sends it, and back; nullopt for NOT_SET and byte arrays, which no parameter of ours
/// has.
[[nodiscard]] rcl_interfaces::msg::ParameterValue to_message(const ParameterValue& value);
[[nodiscard]] std::optional<ParameterValue> from_message(const rcl_interfaces::msg::ParameterValue& message);
[[nodiscard]] rcl_interfaces::msg::ParameterDescriptor descriptor(const std::string& name,
                                                                  const ParameterDeclaration& declaration);
/// Answers rcl_interfaces/srv/ListParameters as rclcpp does (NodeParameters::list_parameters): the names that
/// equal a prefix or lie below it by at most @p depth levels separated by '.' (0: any number), and the
/// prefixes they have.
[[nodiscard]] rcl_interfaces::msg::ListParametersResult list_parameter_names(
    const std::vector<std::string>& names, const std::vector<std::string>& prefixes, std::uint64_t depth);
/// "integer", "double array"...
[[nodiscard]] std::string type_text(const ParameterValue& value);

}  // namespace srfs::ros
