#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Turns .msg, .srv and .action files into plain C++ structs.

Usage: ros_messages.py --out DIR PACKAGE...

Each PACKAGE is a folder (with a '/') that holds msg/, srv/ and action/, or the name of one in a --path or --ros1 folder. A type that
an interface uses is generated, too, if one of these folders has it. DIR/<package>/<kind>/<name_in_snake_case>.hpp is
written for every interface, with the layout of XCDR1 as ROS 2 puts it on the wire (field order is order of declaration; an empty struct
carries one dummy octet) and the DDS names of rmw_fastrtps (pkg::msg::dds_::Name_). Parsing is rosidl_adapter's, so that
a file means here what it means to ROS 2. Files that did not change are not touched.

An action X becomes X_Goal, X_Result, X_Feedback and the types that travel (rosidl's "Actions" design article):
X_SendGoal {goal_id, goal} -> {accepted, stamp}, X_GetResult {goal_id} -> {status, result}, X_FeedbackMessage {goal_id, feedback}.

A field whose name is a word of C++, or one that the structs use, has a '_' behind it in C++.
"""
import argparse
import contextlib
import dataclasses
import io
import math
import pathlib
import re
import sys

try:
    from rosidl_adapter.parser import Field, Type, parse_action_string, parse_message_string, parse_service_string
except ModuleNotFoundError as error:
    sys.exit(f'{error}: install python3-rosidl (this Python is {sys.executable})')

PRIMITIVES = {
    'bool': 'bool', 'byte': 'std::uint8_t', 'char': 'std::uint8_t', 'float32': 'float', 'float64': 'double',
    'int8': 'std::int8_t', 'uint8': 'std::uint8_t', 'int16': 'std::int16_t', 'uint16': 'std::uint16_t',
    'int32': 'std::int32_t', 'uint32': 'std::uint32_t', 'int64': 'std::int64_t', 'uint64': 'std::uint64_t',
}
VIEWS = {'string': 'std::string_view', 'wstring': 'std::u16string_view'}

# Names of members that C++ or the structs themselves have already. rosidl allows lower-case names alone.
TAKEN_NAMES = set(
    'alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t class compl concept const '
    'consteval constexpr constinit const_cast continue co_await co_return co_yield decltype default delete do double dynamic_cast else '
    'enum explicit export extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr '
    'operator or or_eq private protected public register reinterpret_cast requires return short signed sizeof static static_assert '
    'static_cast struct switch template this thread_local throw true try typedef typeid typename union unsigned using virtual void '
    'volatile wchar_t while xor xor_eq linux unix errno assert std visit dds_type_name ros_type_name'.split())
# Written otherwise in ROS 1, whose interface packages Debian has (ros-geometry-msgs and others).
TYPES_OF_ROS1 = {'time': 'builtin_interfaces/Time', 'duration': 'builtin_interfaces/Duration', 'Header': 'std_msgs/Header'}
FIELD_OF_ROS1 = re.compile(r'^[ \t]*(\w+(?:/\w+)?)(\[\d*\])?([ \t]+)(\w+)\b(?![ \t]*=)(.*)$', re.S)


def member(name):
    return name + '_' if name in TAKEN_NAMES else name


def snake(name):
    name = re.sub(r'(.)([A-Z][a-z]+)', r'\1_\2', name)
    return re.sub(r'([a-z0-9])([A-Z])', r'\1_\2', name).lower()


def element_type(field_type):
    if field_type.is_primitive_type():
        if field_type.type == 'string':
            return 'std::string'
        if field_type.type == 'wstring':
            return f'srfs::ros::WideString<{field_type.string_upper_bound or 0}>'
        if field_type.type not in PRIMITIVES:
            raise ValueError(f'type {field_type.type} is not one of ROS 2: builtin_interfaces/Time and Duration are')
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


def escaped(code):
    if 32 <= code < 127:
        return ('\\' if chr(code) in '"\\' else '') + chr(code)
    return f'\\{code:03o}' if code < 256 else f'\\U{code:08x}'


def quoted(text):
    return '"' + ''.join(map(escaped, text.encode())) + '"'


def wide_quoted(text):
    return 'u"' + ''.join(escaped(ord(char)) for char in text) + '"'


def literal(value, primitive):
    if primitive == 'bool':
        return 'true' if value else 'false'
    if primitive == 'string':
        return quoted(str(value))
    if primitive == 'wstring':
        return wide_quoted(str(value))
    if primitive.startswith('float'):
        if not math.isfinite(value):
            raise ValueError(f'a default of {value} is not supported')
        return repr(float(value))
    if primitive == 'uint64':
        return f'{value}ULL'
    if primitive == 'int64' and value == -(2**63):
        return '-9223372036854775807 - 1'  # C++ has no negative literals
    return str(value)


def default_of(field):
    if field.default_value is None:
        return '{}'
    if field.type.is_array:
        return '{' + ', '.join(literal(v, field.type.type) for v in field.default_value) + '}'
    return '{' + literal(field.default_value, field.type.type) + '}'


def visit_line(field):
    t, name = field.type, member(field.name)
    is_string = t.is_primitive_type() and t.type == 'string'
    string_bound = (t.string_upper_bound if is_string else None) or 0
    if t.is_array and (t.array_size is None or t.is_upper_bound):
        return f'v.sequence(s.{name}, {t.array_size or 0}, {string_bound});'
    if t.is_array:
        return f'for (auto& item : s.{name}) v.string(item, {string_bound});' if string_bound else f'v.array(s.{name});'
    if is_string:
        return f'v.string(s.{name}, {string_bound});'
    return f'v.value(s.{name});'


def comment_lines(items):
    return [f'  /// {text}' for c in items if (text := c.strip().rstrip('\\ '))]  # at the end of a line it would take the next one in


def emit_struct(name, dds_name, ros_name, fields, constants):
    out = [f'struct {name} {{']
    out += [f'  static constexpr const char* dds_type_name = "{dds_name}";',
            f'  static constexpr const char* ros_type_name = "{ros_name}";', '']
    for constant in constants:
        kind = VIEWS.get(constant.type) or PRIMITIVES[constant.type]
        out.append(f'  static constexpr {kind} {constant.name} = {literal(constant.value, constant.type)};')
    for field in fields:
        out += comment_lines(field.annotations.get('comment', []))
        out.append(f'  {cpp_type(field.type)} {member(field.name)}{default_of(field)};')
    out += ['', '  /// Calls @p v for every field in wire order; a bound of 0 means unbounded.',
            '  template <class Self, class V>', '  static void visit([[maybe_unused]] Self& s, V& v) {']
    out += [f'    {visit_line(field)}' for field in fields]
    if not fields:
        out.append('    v.empty_struct();')
    out += ['  }', f'  friend bool operator==(const {name}&, const {name}&) = default;', '};']
    return out


def includes_of(specs):
    found = set()
    if any(field.type.is_primitive_type() and field.type.type == 'wstring' for fields, _ in specs for field in fields):
        found.add('ros/wide_string.hpp')
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


def message(name, package, text):
    spec = parse_message_string(package, name, text)
    return [(name, spec.fields, spec.constants)], []


def service_extra(name, package, kind):
    return [f'struct {name} {{', f'  using Request = {name}_Request;', f'  using Response = {name}_Response;',
            f'  static constexpr const char* ros_type_name = "{package}/{kind}/{name}";', '};', '']


def service(name, package, text):
    spec = parse_service_string(package, name, text)
    return ([(f'{name}_Request', spec.request.fields, spec.request.constants),
             (f'{name}_Response', spec.response.fields, spec.response.constants)], service_extra(name, package, 'srv'))


def action(name, package, text):
    spec = parse_action_string(package, name, text)
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


READERS = {'msg': message, 'srv': service, 'action': action}


def in_ros2_notation(text, package):
    """An interface of ROS 1 in the notation of ROS 2: types by their new names, fields in lower case."""
    def line_in_ros2(line):
        if not (found := FIELD_OF_ROS1.match(line)):
            return line
        kind, array, space, name, rest = found.groups()
        if kind != 'Header' or package != 'std_msgs':
            kind = TYPES_OF_ROS1.get(kind, kind)
        return f'{kind}{array or ""}{space}{name.lower()}{rest}'

    return ''.join(map(line_in_ros2, text.splitlines(keepends=True)))


@dataclasses.dataclass(frozen=True)
class Interface:
    package: str
    path: pathlib.Path
    ros1: bool = False

    @property
    def kind(self):
        return self.path.suffix[1:]

    @property
    def header(self):
        return f'{self.package}/{self.kind}/{snake(self.path.stem)}.hpp'

    def text(self):
        text = self.path.read_text()
        return in_ros2_notation(text, self.package) if self.ros1 else text

    def structs(self):
        """[(name, fields, constants)], and the lines behind them. ValueError: what is wrong with the file."""
        complaint = io.StringIO()
        try:
            with contextlib.redirect_stderr(complaint):  # where the parser names the line
                return READERS[self.kind](self.path.stem, self.package, self.text())
        except Exception as error:  # whatever the parser raised
            raise ValueError(f'{self.path}: {complaint.getvalue().strip() or error}') from None


class Folders:
    """Where interfaces are looked for, in this order."""

    def __init__(self, have=(), paths=(), ros1=()):
        self._have = have
        self._places = [(place, False) for place in paths] + [(place, True) for place in ros1]

    def has_header(self, interface):
        return any((place / interface.package / interface.kind / interface.path.name).is_file() for place in self._have)

    def package(self, name):
        """All interfaces of a package. @param name  or its folder, then with a '/' in it"""
        places = [(pathlib.Path(name).resolve(), False)] if '/' in name else [(place / name, ros1) for place, ros1 in self._places]
        for folder, ros1 in places:
            found = [Interface(folder.name, path, ros1) for kind in READERS for path in sorted((folder / kind).glob('*.' + kind))]
            if found:
                return found
        if any((place / name).is_dir() for place in self._have):
            return []
        raise ValueError(f'{name}: no interfaces ' + ('there' if '/' in name else self._looked_in(name)))

    def message(self, package, name, used_by):
        """The file of a type that another one uses; None: its header is there."""
        file = pathlib.Path(package, 'msg', name + '.msg')
        if self.has_header(Interface(package, file)):
            return None
        for place, ros1 in self._places:
            if (place / file).is_file():
                return Interface(package, place / file, ros1)
        raise ValueError(f'{used_by}: uses {package}/{name}, which is not {self._looked_in(package)}')

    def _looked_in(self, package):
        places = ' or '.join(str(place) for place, _ in self._places) or 'any folder'
        return f'in {places}: name its folder, use the setup.bash of a ROS 2, or install Debian\'s ros-{package.replace("_", "-")}'


def used_types(structs):
    return sorted({(field.type.pkg_name, field.type.type) for _, fields, _ in structs for field in fields
                   if not field.type.is_primitive_type() and kind_of(field.type) == 'msg'})


def with_all_used(interfaces, folders):
    """[(interface, structs, lines behind them)] of the interfaces and of those that they use, directly and indirectly."""
    ahead = [interface for interface in interfaces if not folders.has_header(interface)]
    known = {(interface.package, interface.path.stem) for interface in ahead if interface.kind == 'msg'}
    done = []
    while ahead:
        interface = ahead.pop(0)
        structs, extra = interface.structs()
        done.append((interface, structs, extra))
        for package, name in used_types(structs):
            if (package, name) not in known:
                known.add((package, name))
                used = folders.message(package, name, interface.path)
                ahead += [used] if used else []
    refuse_cycles(done)
    return done


def refuse_cycles(done):
    """A type that has itself as a part has no end, and its headers include each other."""
    ahead = {(interface.package, interface.path.stem): set(used_types(structs)) for interface, structs, _ in done if interface.kind == 'msg'}
    while leaves := [name for name, used in ahead.items() if not used & ahead.keys()]:
        for name in leaves:
            del ahead[name]
    if ahead:
        raise ValueError('these types have each other as parts: ' + ', '.join(map('/'.join, sorted(ahead))))


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def generate(done, out, texts):
    for interface, structs, extra in done:
        source = f'{interface.package}/{interface.kind}/{interface.path.name}'
        try:
            text = emit_file(source, interface.package, interface.kind, structs, extra)
        except ValueError as error:
            raise ValueError(f'{interface.path}: {error}') from None
        write(out / interface.header, text)
        if texts:
            write(texts / source, interface.text())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    folder = {'type': pathlib.Path, 'action': 'append', 'default': [], 'metavar': 'DIR'}
    parser.add_argument('--out', type=pathlib.Path, required=True)
    parser.add_argument('--have', help='packages whose headers are there already', **folder)
    parser.add_argument('--path', help='packages that may be used: DIR/PACKAGE/msg', **folder)
    parser.add_argument('--ros1', help='the same in the notation of ROS 1', **folder)
    parser.add_argument('--texts', type=pathlib.Path, metavar='DIR', help='gets DIR/PACKAGE/msg/NAME.msg of all that is generated')
    parser.add_argument('--own', nargs='+', default=[], metavar=('PACKAGE', 'FILE'), help='a package and its files')
    parser.add_argument('--list', action='store_true', help='print the headers, separated by semicolons; write nothing')
    parser.add_argument('--inputs', action='store_true', help='print the files that were read, separated by semicolons')
    parser.add_argument('packages', nargs='*')
    options = parser.parse_args()
    folders = Folders(options.have, options.path, options.ros1)
    try:
        interfaces = [interface for package in options.packages for interface in folders.package(package)]
        interfaces += [own_file(options.own[0], pathlib.Path(file)) for file in options.own[1:]]
        done = with_all_used(interfaces, folders)
        if not options.list:
            generate(done, options.out, options.texts)
    except (ValueError, OSError) as error:  # one line that names the file
        sys.exit(str(error))
    if options.list:
        print(';'.join(str(options.out / interface.header) for interface, _, _ in done), end='')
    if options.inputs:
        print(';'.join(str(interface.path) for interface, _, _ in done), end='')


def own_file(package, path):
    if path.suffix[1:] not in READERS:
        raise ValueError(f'{path}: not a .msg, .srv or .action file')
    return Interface(package, path.resolve())


if __name__ == '__main__':
    main()
