#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Turns .msg, .srv and .action files into plain C++ structs.

Usage: ros_messages.py --out DIR PACKAGE_FOLDER...

Each PACKAGE_FOLDER holds msg/, srv/ and action/. DIR/<package>/<kind>/<name_in_snake_case>.hpp is written for every
interface, with the layout of XCDR1 as ROS 2 puts it on the wire (field order is order of declaration; an empty struct
carries one dummy octet) and the DDS names of rmw_fastrtps (pkg::msg::dds_::Name_). Parsing is rosidl_adapter's, so that
a file means here what it means to ROS 2. Files that did not change are not touched.

An action X becomes X_Goal, X_Result, X_Feedback and the types that travel (rosidl's "Actions" design article):
X_SendGoal {goal_id, goal} -> {accepted, stamp}, X_GetResult {goal_id} -> {status, result}, X_FeedbackMessage {goal_id, feedback}.
"""
import argparse
import pathlib
import re
import sys

from rosidl_adapter.parser import Field, Type, parse_action_file, parse_message_file, parse_service_file

PRIMITIVES = {
    'bool': 'bool', 'byte': 'std::uint8_t', 'char': 'std::uint8_t', 'float32': 'float', 'float64': 'double',
    'int8': 'std::int8_t', 'uint8': 'std::uint8_t', 'int16': 'std::int16_t', 'uint16': 'std::uint16_t',
    'int32': 'std::int32_t', 'uint32': 'std::uint32_t', 'int64': 'std::int64_t', 'uint64': 'std::uint64_t',
}


def snake(name):
    name = re.sub(r'(.)([A-Z][a-z]+)', r'\1_\2', name)
    return re.sub(r'([a-z0-9])([A-Z])', r'\1_\2', name).lower()


def element_type(field_type):
    if field_type.is_primitive_type():
        if field_type.type == 'string':
            return 'std::string'
        if field_type.type not in PRIMITIVES:
            raise ValueError(f'type {field_type.type} is not supported')
        return PRIMITIVES[field_type.type]
    return f'{field_type.pkg_name}::{kind_of(field_type)}::{field_type.type}'


class PartOfAction(Type):
    """The goal, result or feedback of an action as a member of the types that travel; no .msg file can name it."""

    def __init__(self, package, name):
        super().__init__(f'{package}/{name.replace("_", "")}')  # rosidl allows no underscore in a type's name
        self.type = name


def kind_of(field_type):
    return 'action' if isinstance(field_type, PartOfAction) else 'msg'


def cpp_type(field_type):
    element = element_type(field_type)
    if not field_type.is_array:
        return element
    if field_type.array_size is not None and not field_type.is_upper_bound:
        return f'std::array<{element}, {field_type.array_size}>'
    return f'std::vector<{element}>'


def literal(value, primitive):
    if primitive == 'bool':
        return 'true' if value else 'false'
    if primitive == 'string':
        return '"' + str(value).replace('\\', '\\\\').replace('"', '\\"') + '"'
    if primitive == 'uint64':
        return f'{value}ULL'
    return str(value)


def default_of(field):
    if field.default_value is None:
        return '{}'
    if field.type.is_array:
        return '{' + ', '.join(literal(v, field.type.type) for v in field.default_value) + '}'
    return '{' + literal(field.default_value, field.type.type) + '}'


def visit_line(field):
    t = field.type
    string_bound = t.string_upper_bound if t.is_primitive_type() and t.type == 'string' else None
    if t.is_array and (t.array_size is None or t.is_upper_bound):
        return f'v.sequence(s.{field.name}, {t.array_size or 0}, {string_bound or 0});'
    if t.is_array:
        return f'v.array(s.{field.name});'
    if t.is_primitive_type() and t.type == 'string':
        return f'v.string(s.{field.name}, {string_bound or 0});'
    return f'v.value(s.{field.name});'


def comment_lines(items):
    return [f'  /// {c.strip()}' for c in items if c.strip()]


def emit_struct(name, dds_name, ros_name, fields, constants):
    out = [f'struct {name} {{']
    out += [f'  static constexpr const char* dds_type_name = "{dds_name}";',
            f'  static constexpr const char* ros_type_name = "{ros_name}";', '']
    for constant in constants:
        kind = 'std::string_view' if constant.type == 'string' else PRIMITIVES[constant.type]
        out.append(f'  static constexpr {kind} {constant.name} = {literal(constant.value, constant.type)};')
    for field in fields:
        out += comment_lines(field.annotations.get('comment', []))
        out.append(f'  {cpp_type(field.type)} {field.name}{default_of(field)};')
    out += ['', '  /// Calls @p v for every field in wire order; a bound of 0 means unbounded.',
            '  template <class Self, class V>', '  static void visit([[maybe_unused]] Self& s, V& v) {']
    out += [f'    {visit_line(field)}' for field in fields]
    if not fields:
        out.append('    v.empty_struct();')
    out += ['  }', f'  friend bool operator==(const {name}&, const {name}&) = default;', '};']
    return out


def includes_of(specs):
    found = set()
    for fields, _ in specs:
        for field in fields:
            if not field.type.is_primitive_type() and kind_of(field.type) == 'msg':
                found.add(f'{field.type.pkg_name}/msg/{snake(field.type.type)}.hpp')
    return sorted(found)


def emit_file(source, package, kind, structs, extra):
    lines = [f'// Generated from {source} by msgs/generator/ros_messages.py.', '#pragma once', '',
             '#include <array>', '#include <cstdint>', '#include <string>', '#include <string_view>', '#include <vector>', '']
    headers = includes_of([(f, c) for _, f, c in structs])
    lines += [f'#include <{h}>' for h in headers] + ([''] if headers else [])
    lines += [f'namespace {package}::{kind} {{', '']
    for name, fields, constants in structs:
        lines += emit_struct(name, f'{package}::{kind}::dds_::{name}_', f'{package}/{kind}/{name}', fields, constants) + ['']
    lines += extra
    lines += [f'}}  // namespace {package}::{kind}', '']
    return '\n'.join(lines)


def message(path, package):
    spec = parse_message_file(package, str(path))
    return [(path.stem, spec.fields, spec.constants)], []


def service_extra(name, package, kind):
    return [f'struct {name} {{', f'  using Request = {name}_Request;', f'  using Response = {name}_Response;',
            f'  static constexpr const char* ros_type_name = "{package}/{kind}/{name}";', '};', '']


def service(path, package):
    spec = parse_service_file(package, str(path))
    name = path.stem
    return ([(f'{name}_Request', spec.request.fields, spec.request.constants),
             (f'{name}_Response', spec.response.fields, spec.response.constants)], service_extra(name, package, 'srv'))


def action(path, package):
    spec = parse_action_file(package, str(path))
    name = path.stem
    goal_id = Field(Type('unique_identifier_msgs/UUID'), 'goal_id')
    own = {part: Field(PartOfAction(package, f'{name}_{part}'), part.lower()) for part in ('Goal', 'Result', 'Feedback')}
    parts = [(f'{name}_{part}', message_spec.fields, message_spec.constants)
             for part, message_spec in (('Goal', spec.goal), ('Result', spec.result), ('Feedback', spec.feedback))]
    wrappers = [(f'{name}_SendGoal_Request', [goal_id, own['Goal']]),
                (f'{name}_SendGoal_Response', [Field(Type('bool'), 'accepted'), Field(Type('builtin_interfaces/Time'), 'stamp')]),
                (f'{name}_GetResult_Request', [goal_id]),
                (f'{name}_GetResult_Response', [Field(Type('int8'), 'status'), own['Result']]),
                (f'{name}_FeedbackMessage', [goal_id, own['Feedback']])]
    extra = [f'struct {name} {{']
    extra += [f'  using {part} = {name}_{part};' for part in ('Goal', 'Result', 'Feedback', 'SendGoal', 'GetResult', 'FeedbackMessage')]
    extra += [f'  static constexpr const char* ros_type_name = "{package}/action/{name}";', '};', '']
    return (parts + [(wrapper, fields, []) for wrapper, fields in wrappers],
            service_extra(f'{name}_SendGoal', package, 'action') + service_extra(f'{name}_GetResult', package, 'action') + extra)


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=pathlib.Path, required=True)
    parser.add_argument('--list', action='store_true', help='print the headers, separated by semicolons; write nothing')
    parser.add_argument('packages', type=pathlib.Path, nargs='+')
    options = parser.parse_args()
    headers = []
    for folder in options.packages:
        package = folder.name
        for kind, reader in (('msg', message), ('srv', service), ('action', action)):
            for path in sorted((folder / kind).glob('*.' + kind)):
                headers.append(options.out / package / kind / f'{snake(path.stem)}.hpp')
                if options.list:
                    continue
                try:
                    structs, extra = reader(path, package)
                    text = emit_file(f'{package}/{kind}/{path.name}', package, kind, structs, extra)
                except Exception as error:  # one line that names the file, whatever the parser raised
                    sys.exit(f'{path}: {error}')
                write(headers[-1], text)
    if options.list:
        print(';'.join(map(str, headers)), end='')


if __name__ == '__main__':
    main()
