// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
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
  double step = 0;  ///< allowed are lowest + n * step, and highest; 0: everything between
};

struct ParameterDeclaration {
  ParameterValue default_value;  ///< its type is the parameter's type
  std::optional<ParameterRange> range;
  std::string description;
  bool read_only = false;              ///< changes at the next start only, by its stored value
  std::vector<std::string> choices{};  ///< of a text (every element of an array); empty: any
  bool guarded = false;                ///< a change is on trial until it is confirmed (ParameterStorage)
};

/// A value that outlives the node (VAR/state/<node>/parameters.yaml).
struct StoredParameter {
  std::string name;
  ParameterValue value;
  std::string saved;  ///< when, UTC, for people
  friend bool operator==(const StoredParameter&, const StoredParameter&) = default;
};

/// A stored value that is not used, and why.
struct SetAside {
  StoredParameter parameter;
  std::string reason;
};

/// Longest text and list that a parameter takes, and octets of a reason why it does not.
inline constexpr std::size_t longest_parameter_text = 4096;
inline constexpr std::size_t longest_parameter_list = 1024;
inline constexpr std::size_t longest_refusal = 250;

/// The parameters of one node: declared once with type, range and default, started from the stored values,
/// else the deployment file's, changed at run time only after every rule and the node's own callbacks agreed.
/// Pure: no DDS.
class ParameterSet {
 public:
  /// Refuses the change of one parameter with a reason, for people. Nothing is applied yet.
  using Check =
      std::function<Result<void, std::string>(const std::string& name, const ParameterValue& value)>;
  /// The parameters as they would be.
  class Proposal {
   public:
    [[nodiscard]] const ParameterValue* find(const std::string& name) const;

   private:
    friend class ParameterSet;
    Proposal(const ParameterSet& set, const std::vector<std::pair<std::string, ParameterValue>>& changes)
        : set_(set), changes_(changes) {}
    const ParameterSet& set_;
    const std::vector<std::pair<std::string, ParameterValue>>& changes_;
  };
  /// Refuses a set of changes that do not go together. Called after each was found fine by itself.
  using SetCheck = std::function<Result<void, std::string>(const Proposal& proposal)>;
  /// Called after the change holds.
  using Changed = std::function<void(const std::string& name)>;
  /// Called once after all changes of a set hold, and after Changed of each.
  using Applied = std::function<void(const std::vector<std::string>& names)>;

  ParameterSet() = default;
  /// @param overrides the node's `parameters` mapping of the deployment file
  explicit ParameterSet(ConfigSection overrides) : overrides_(std::move(overrides)) {}
  /// Values that go over the deployment's. Before the first declaration.
  void set_stored(std::vector<StoredParameter> stored);

  /// Declares and returns the start value: the stored value, else the override, else the default. Throws
  /// ConfigError for an override of the wrong type or range; such a stored value is set aside.
  const ParameterValue& declare(const std::string& name, ParameterDeclaration declaration);
  /// Throws ConfigError for undeclared overrides. Stored values that are undeclared, or refused by the node's
  /// check, are set aside. After all declarations.
  void finish();
  /// Stored values that are not used.
  [[nodiscard]] const std::vector<SetAside>& set_aside() const { return set_aside_; }

  /// A change of this parameter is on trial until it is confirmed. Before or after its declaration.
  void guard(const std::string& name) { guarded_.insert(name); }
  [[nodiscard]] bool is_guarded(const std::string& name) const { return guarded_.contains(name); }
  /// Why the next start could not use this value; empty: it can.
  [[nodiscard]] std::string next_start_refusal(const std::string& name, const ParameterValue& value) const {
    return refusal(name, value, For::next_start);
  }
  /// Back to values that held before, without the node's check.
  void put_back(const std::vector<std::pair<std::string, ParameterValue>>& values);
  void set_stored_now(std::vector<StoredParameter> stored) { stored_ = std::move(stored); }
  /// What the next start takes over the deployment's values, without what was set aside.
  [[nodiscard]] const std::vector<StoredParameter>& stored() const { return stored_; }

  /// All or none. @return per parameter its refusal (empty: fine); all empty means all were applied
  [[nodiscard]] std::vector<std::string> set_atomically(
      const std::vector<std::pair<std::string, ParameterValue>>& changes);
  [[nodiscard]] const ParameterValue* find(const std::string& name) const;
  /// Of the deployment or the default; nullptr: no such parameter.
  [[nodiscard]] const ParameterValue* find_start(const std::string& name) const;
  /// With the mark of a guarded one.
  [[nodiscard]] std::optional<ParameterDeclaration> declaration(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> names() const;

  void set_check(Check check) { check_ = std::move(check); }
  void set_set_check(SetCheck check) { set_check_ = std::move(check); }
  void set_changed(Changed changed) { changed_ = std::move(changed); }
  void set_applied(Applied applied) { applied_ = std::move(applied); }

 private:
  struct Entry {
    ParameterDeclaration declaration;
    ParameterValue value;
    ParameterValue start;  ///< of the deployment or the default
  };
  enum class For : std::uint8_t { now, next_start };
  void apply(const std::vector<std::pair<std::string, ParameterValue>>& changes);
  [[nodiscard]] std::string refusal(const std::string& name, const ParameterValue& value, For when) const;
  [[nodiscard]] std::optional<ParameterValue> stored_start(const std::string& name,
                                                           const ParameterDeclaration& declaration);
  void put_aside(const std::string& name, std::string reason);

  std::optional<ConfigSection> overrides_;
  std::map<std::string, Entry> entries_;
  std::vector<StoredParameter> stored_;
  std::vector<SetAside> set_aside_;
  std::set<std::string> guarded_;
  Check check_;
  SetCheck set_check_;
  Changed changed_;
  Applied applied_;
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
