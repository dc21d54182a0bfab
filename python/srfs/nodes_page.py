# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference/nodes.md: topics, services, actions and parameters of each node, from the sources that make them.

    python3 -m srfs.nodes_page            # writes the page
    python3 -m srfs.nodes_page --check    # exit code 1 when it is stale

It reads the calls `create_publisher(...)`, `declare_parameter(...)` and so on. A call that it does not understand is an
error, so nothing is missing silently; a flight compares the page with what the nodes have (tests/system/test_ros_tools.py).
"""

import argparse
import dataclasses
import functools
import re
import sys
import textwrap

from srfs import ROOT

PAGE = ROOT / "docs" / "reference" / "nodes.md"
HEAD = """# Nodes

Topics, services, actions and parameters of each node, under the names and types of ROS 2. Written by
`python3 -m srfs.nodes_page` from the sources; tests report when it is stale or a flight differs.

- `~` is the node's own name, `NODE` that of another node. Remapping and namespaces change names.
- A value is the program's default; a deployment may state another one.
- A running suite shows the same: `srfs graph`, `srfs param describe NODE`.
- What goes to the ground is in the [dictionary](dictionary.md).
"""

EVERY_NODE = ("lib/ros/lifecycle_node.cpp", "lib/suite/*.cpp", "lib/suite/ring/*.cpp")
COMMANDED = ("lib/suite/commanding/*.cpp",)  # what a CommandedNode has besides
TOPICS = ("lib/ros/topics.hpp", "lib/suite/topics.hpp", "lib/suite/image_topics.hpp")

# function -> list of the page, kind of its type
CALLS = {
    "create_publisher": ("Publishes", "msg"),
    "create_subscription": ("Subscribes to", "msg"),
    "create_service": ("Serves", "srv"),
    "create_order_service": ("Serves", "srv"),
    "create_deferred_service": ("Serves", "srv"),
    "create_client": ("Calls", "srv"),
    "create_action_server": ("Actions", "action"),
    "create_action_client": ("Orders", "action"),
}
LISTS = tuple(dict.fromkeys(words for words, _ in CALLS.values()))
KEYS = {  # of `srfs graph --json`
    "Publishes": "publishers",
    "Subscribes to": "subscriptions",
    "Serves": "services",
    "Calls": "clients",
    "Actions": "action_servers",
    "Orders": "action_clients",
}
CALL = re.compile(rf"\b({'|'.join(CALLS)}|declare_parameter)(?:<([\w:]+)>)?\(")
# The ring's own client (liveness_ring.cpp); its names come from check_alive_name().
RING_CLIENT = re.compile(r"request_dds_name\(check_alive_name\(\w+\)\)")
CHECK_ALIVE = "/NODE/check_alive"


@dataclasses.dataclass(frozen=True, order=True)
class End:
    name: str  # "~/get_state"
    type: str  # "lifecycle_msgs/srv/GetState"
    qos: str = ""


@dataclasses.dataclass(frozen=True, order=True)
class Parameter:
    name: str
    type: str
    range: str  # "1 to 60000", or the choices
    default: str
    read_only: bool
    meaning: str


@dataclasses.dataclass
class Node:
    """What a class of nodes has, beyond its base class."""

    ends: dict  # {list: {End}}
    parameters: set


@functools.cache
def sources(*patterns):
    files = [file for pattern in patterns for file in sorted(ROOT.glob(pattern)) if "test" not in file.parts]
    return "\n".join(file.read_text() for file in files)


def arguments_after(text, start):
    """The arguments of a call, from behind its parenthesis; each without line breaks."""
    depth, quoted, begin, found = 0, False, start, []
    for at in range(start, len(text)):
        c = text[at]
        if c == '"' and text[at - 1] != "\\":
            quoted = not quoted
        elif quoted:
            continue
        elif c in "([{":
            depth += 1
        elif c in ")]}" and depth > 0:
            depth -= 1
        elif c in "),}" and depth == 0:
            found.append(" ".join(text[begin:at].split()))
            begin = at + 1
            if c == ")":
                return found
    raise ValueError(f"a call without an end: {text[start : start + 60]}")


def literal_of(expression):
    """The text of one or more adjacent string literals; None: something else."""
    parts = re.findall(r'"((?:[^"\\]|\\.)*)"', expression)
    return "".join(parts) if parts and re.fullmatch(r'("(?:[^"\\]|\\.)*"\s*)+', expression) else None


# ---------------------------------------------------------------- names and types


@functools.cache
def types():
    """{(kind, name): type}: ("msg", "TimeTick"): "srfs_msgs/msg/TimeTick"."""
    files = [file for kind in ("msg", "srv", "action") for file in (ROOT / "msgs").rglob(f"*.{kind}")]
    return {(file.suffix[1:], file.stem): "/".join((file.parts[-3], file.suffix[1:], file.stem)) for file in files}


def aliases(text):
    """{"Capture": "CaptureImage"}: short names that a class gives to interfaces."""
    return dict(re.findall(r"using (\w+) = (?:\w+::)+(?:srv|action|msg)::(\w+);", text))


def name_of(expression):
    """"/NODE/get_state" of `"/" + node + "/get_state"`."""
    if (text := literal_of(expression)) is not None:
        return text
    parts = [literal_of(part.strip()) for part in expression.split(" + ")]
    if len(parts) < 2 or not any(parts):
        raise ValueError(f"no name of a topic or service: {expression}")
    return "".join("NODE" if part is None else part for part in parts)


def qos_of(text):
    words = {"best_effort": "best effort", "transient_local": "transient local"}
    return ", ".join(words[key] for key in words if f".{key} = true" in text)


class Topics:
    """The topics that are declared once (topics.hpp)."""

    def __init__(self):
        text = sources(*TOPICS)
        one = re.compile(r'inline const (?:ros::)?Topic<([\w:]+)> (\w+)\{\s*"([^"]+)",\s*\{([^}]*)\}')
        of_node = re.compile(r'inline (?:ros::)?Topic<([\w:]+)> (\w+)\(const std::string& node\) \{\s*return \{"/" \+ node \+ "([^"]+)", \{([^}]*)\}')
        self.fixed = {name: (topic, type_name, qos_of(qos)) for type_name, name, topic, qos in one.findall(text)}
        self.of_node = {name: (topic, type_name, qos_of(qos)) for type_name, name, topic, qos in of_node.findall(text)}

    def find(self, expression):
        """(name, type as written, QoS) of `suite::topics::telemetry(name())` or `ros::Topic<T>{"/x", {}}`."""
        if own := re.fullmatch(r"(?:ros::)?Topic<([\w:]+)>\{(.+), \{(.*)\}\}", expression):
            return name_of(own[2]), own[1], qos_of(own[3])
        named = re.fullmatch(r"(?:suite::|ros::)?topics::(\w+)(?:\((.*)\))?", expression)
        if named and named[2] is None and named[1] in self.fixed:
            return self.fixed[named[1]]
        if named and named[2] is not None and named[1] in self.of_node:
            topic, type_name, qos = self.of_node[named[1]]
            return ("~" if named[2] == "name()" else "/NODE") + topic, type_name, qos
        raise ValueError(f"no topic: {expression}")


# ---------------------------------------------------------------- parameters


def number_of(expression, text):
    """The value of a number: `std::int64_t{86'400}`, `30 * day_s`; None: it is the dictionary's."""
    expression = re.sub(r"std::\w+\{(.*)\}", r"\1", expression).replace("'", "")
    if re.fullmatch(r"[-\d.]+", expression):
        return float(expression) if "." in expression else int(expression)
    if " * " in expression:
        one, other = (number_of(factor, text) for factor in expression.split(" * "))
        return one * other
    if expression.startswith("mission::"):
        return None
    constant = re.search(rf"constexpr [\w:]+ {expression.split('::')[-1]} = ([^;]+);", text + sources("lib/image/frame.hpp", "lib/base/time.hpp"))
    if not constant:
        raise ValueError(f"no number: {expression}")
    return number_of(constant[1], text)


def value_of(expression, text):
    """(type, default)"""
    if quoted := re.fullmatch(r"std::string\((.*)\)", expression):
        return "string", f"`{literal_of(quoted[1])}`"
    if expression in ("true", "false"):
        return "bool", expression
    if empty := re.fullmatch(r"std::vector<std::(\w+)>\{\}", expression):
        return {"string": "string array", "int64_t": "integer array"}[empty[1]], "[]"
    number = number_of(expression, text)
    return ("double" if isinstance(number, float) else "integer"), "of the dictionary" if number is None else str(number)


def range_of(expression, text):
    """"1 to 60000", or the choices; None: the expression is neither."""
    if bounds := re.fullmatch(r"(?:ros::)?ParameterRange\{(.*)\}", expression):
        return " to ".join(str(number_of(bound, text)) for bound in bounds[1].split(", "))
    if choices := re.fullmatch(r"(?:std::vector<std::string>)?\{(.*)\}", expression):
        return ", ".join(f"`{literal_of(choice)}`" for choice in choices[1].split(", "))
    return None


def parameter_of(arguments, text):
    name, default, *rest = arguments
    limits = range_of(rest[0], text)
    if limits is not None:
        rest = rest[1:]
    description, read_only = literal_of(rest[0]), rest[1:] == ["true"]
    if literal_of(name) is None or description is None or rest[1:] not in ([], ["true"], ["false"]):
        raise ValueError(f"no declaration of a parameter: {arguments}")
    kind, value = value_of(default, text)
    return Parameter(literal_of(name), kind, limits or "", value, read_only, description.rstrip("."))


# ---------------------------------------------------------------- the page


def node_of(text):
    """What the sources @p text make."""
    topics, known, short = Topics(), types(), aliases(text)
    node = Node({words: set() for words in LISTS}, set())
    for call in CALL.finditer(text):
        arguments = arguments_after(text, call.end())
        if call[1] == "declare_parameter":
            node.parameters.add(parameter_of(arguments, text))
            continue
        words, kind = CALLS[call[1]]
        if kind == "msg":
            name, type_name, qos = topics.find(arguments[0])
        else:
            name, type_name, qos = "", call[2], ""
        last = type_name.split("::")[-1]
        last = short.get(last, last)
        if kind != "msg":
            name = CHECK_ALIVE if (last, arguments[0]) == ("CheckAlive", "service") else name_of(arguments[0])
        node.ends[words].add(End(name, known[kind, last], qos))
    if RING_CLIENT.search(text):
        node.ends["Calls"].add(End(CHECK_ALIVE, known["srv", "CheckAlive"]))
    return node


@functools.cache
def nodes():
    """{title: Node}: every node, every payload, and each program."""
    found = {"Every node": node_of(sources(*EVERY_NODE))}
    for name in ("timing", "can_switcher", "payload", "ttc", "image_acquisition", "image_processing", "maintenance"):
        own = [f"nodes/{name}/*.?pp"]
        commanded = COMMANDED if ": public CommandedNode" in sources(*own) else ()
        found["Every payload node" if name == "payload" else name] = node_of(sources(*own, *commanded))
    for folder in sorted((ROOT / "mission").glob("payload_*")):
        own = node_of(sources(f"mission/{folder.name}/*.?pp"))
        if own.parameters or any(own.ends.values()):
            found[folder.name] = own
    return found


def section(title, node):
    yield f"\n## {title}"
    for words in LISTS:
        if not node.ends[words]:
            continue
        yield f"\n{words}:\n"
        for end in sorted(node.ends[words]):
            package, _, name = end.type.split("/")
            yield f"- `{end.name}` ({package}/{name})" + (f", {end.qos}" if end.qos else "")
    if node.parameters:
        yield "\nParameters:\n"
        yield from map(parameter_text, sorted(node.parameters))


def parameter_text(p):
    about = ", ".join(filter(None, (p.type, p.range, f"default {p.default}")))
    change = "; changes at the next start" if p.read_only else ""
    return textwrap.fill(f"- `{p.name}`: {about}{change}. {p.meaning}.", 100, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def page():
    return HEAD + "\n".join(line for title, node in nodes().items() for line in section(title, node)) + "\n"


# ---------------------------------------------------------------- compared with a flight


def sections_of(name):
    """The titles that a node of the deployments of this tree has."""
    own = ["Every payload node", name] if name.startswith("payload_") else [name]
    return ["Every node", *own]


def general(name, node):
    """How the page may name what @p node has: "~/tick", "/NODE/tick" or "/timing/tick" of "/timing/tick"."""
    first, _, rest = name[1:].partition("/")
    return {name, f"/NODE/{rest}"} | ({f"~/{rest}"} if first == node else set())


def classes_of(name, known):
    return [known[title] for title in sections_of(name) if title in known]


def missing_ends(graph):
    """What nodes have and the page does not. @param graph  {node without slash: its entry of `srfs graph --json`}"""
    known, missing = nodes(), []
    for name, entry in graph.items():
        for words in LISTS:
            on_page = {(end.name, end.type) for node in classes_of(name, known) for end in node.ends[words]}
            for end in entry[KEYS[words]]:
                if not on_page & {(name_on_page, end["type"]) for name_on_page in general(end["name"], name)}:
                    missing.append(f"{name} {KEYS[words]}: {end['name']} ({end['type']})")
    return missing


def parameters_on_page(name):
    return {parameter.name for node in classes_of(name, nodes()) for parameter in node.parameters}


def main():
    parser = argparse.ArgumentParser(description="Writes docs/reference/nodes.md from the sources of the nodes.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when the page is stale")
    arguments = parser.parse_args()
    if not arguments.check:
        PAGE.write_text(page())
    elif not PAGE.exists() or PAGE.read_text() != page():
        print(f"{PAGE} is stale: PYTHONPATH=python python3 -m srfs.nodes_page", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
