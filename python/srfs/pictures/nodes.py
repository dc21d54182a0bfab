# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/pictures/nodes.svg: the nodes of launch_config/sim.yaml and what flows between them. Again after a node or flow changed."""

from srfs.flight import deployments

WIDTH, HEIGHT = 1000, 676
RING_Y, RING_LEFT, RING_STEP = 622, 24, 107

# name: x, y, width, height, what it does (lines)
NODES = {
    "timing": (230, 86, 140, 84, ("clock, tick,", "feeds the watchdog")),
    "can_switcher": (470, 86, 160, 84, ("one payload at a time",)),
    "payload_adcs": (818, 56, 158, 46, ()),
    "payload_eps": (818, 114, 158, 46, ()),
    "payload_thermal": (818, 172, 158, 46, ()),
    "ttc": (470, 306, 160, 84, ("telecommands, stores,", "frames, files, beacon")),
    "image_acquisition": (212, 488, 164, 66, ("frames at the commanded", "time, stored as FITS")),
    "image_processing": (436, 488, 164, 66, ("streaks, tracklets,", "attitude, products")),
    "maintenance": (660, 488, 150, 66, ("versions, updates,", "parameters, scrubbing")),
}
# x, y, width, height, name, small line
DEVICES = (
    (24, 66, 130, 46, "GPS receiver", ""),
    (24, 146, 130, 46, "watchdog", ""),
    (24, 344, 130, 54, "ground", "srfs-ground"),
    (24, 496, 130, 50, "camera", "V4L2 or simulated"),
    (846, 406, 136, 44, "CAN bus", ""),
    (846, 496, 136, 50, "peripherals", "ADCS, EPS, thermal"),
)
# path, ends with arrow heads (start, end)
FLOWS = (
    ("M154,89 L229,108", False),
    ("M230,148 L155,167", False),
    ("M370,128 H469", False),
    ("M630,108 H805", False),
    ("M806,152 H631", False),
    ("M300,170 V330 H469", False),
    ("M836,230 V330 H631", False),
    ("M630,368 H866 V231", False),
    ("M940,231 V405", True),
    ("M914,451 V495", True),
    ("M155,371 H469", True),
    ("M510,390 V446 H294 V487", False),
    ("M530,390 V487", False),
    ("M376,521 H435", False),
    ("M566,487 V391", False),
    ("M610,390 V446 H735 V487", True),
    ("M154,521 H211", False),
)
TOPIC, SMALL = "topic", "small"
# class, x, y, text; "start": from x on
LABELS = (
    (SMALL, 196, 78, "pulse, time"),
    (SMALL, 200, 180, "feed"),
    (TOPIC, 420, 119, "/timing/tick"),
    (TOPIC, 718, 84, "/can/task_flags"),
    (TOPIC, 718, 99, "/can/reset_peripheral"),
    (TOPIC, 718, 168, "/can/bus_status"),
    (TOPIC, 385, 322, "/timing/tick"),
    (TOPIC, 733, 292, "/<node>/telemetry"),
    (TOPIC, 733, 307, "/telecommand_report"),
    (TOPIC, 733, 322, "/event"),
    (TOPIC, 748, 384, "/telecommand"),
    (f"{SMALL} start", 946, 330, "ISO-TP"),
    (SMALL, 312, 363, "RS422"),
    (SMALL, 312, 387, "telecommands up, telemetry and files down"),
    (TOPIC, 400, 437, "/image/capture"),
    (f"{TOPIC} end", 524, 472, "/image/process"),
    (f"{SMALL} start", 572, 472, "products"),
    (SMALL, 406, 512, "frames"),
    (f"{TOPIC} start", 640, 437, "/telecommand"),
    (f"{SMALL} start", 741, 472, "sources, reports"),
    (SMALL, 183, 512, "pixels"),
)
STYLE = """    .panel { fill: #ffffff; stroke: #c9d1d9 }
    .node { fill: #dbeafe; stroke: #1d4ed8; stroke-width: 1.5 }
    .ring { fill: none; stroke: #15803d; stroke-width: 1.5 }
    .ring-node { fill: #dcfce7; stroke: #15803d; stroke-width: 1.2 }
    .group { fill: none; stroke: #1d4ed8; stroke-width: 1 }
    .device { fill: #f1f3f5; stroke: #57606a; stroke-width: 1.2 }
    .flow { fill: none; stroke: #24292f; stroke-width: 1.5 }
    .head { fill: #24292f }
    .ring-head { fill: #15803d }
    text { fill: #1f2328; text-anchor: middle }
    .name { font-weight: 600 }
    .small { font-size: 11px; fill: #57606a }
    .ring-name { font-size: 9.5px }
    .topic { font-family: ui-monospace, 'DejaVu Sans Mono', Menlo, monospace; font-size: 11px }
    .start { text-anchor: start }
    .end { text-anchor: end }
    @media (prefers-color-scheme: dark) {
      .panel { fill: #0d1117; stroke: #30363d }
      .node { fill: #15294d; stroke: #6ea8fe }
      .ring { stroke: #4ade80 }
      .ring-node { fill: #052e16; stroke: #4ade80 }
      .group { stroke: #6ea8fe }
      .device { fill: #21262d; stroke: #8b949e }
      .flow { stroke: #e6edf3 }
      .head { fill: #e6edf3 }
      .ring-head { fill: #4ade80 }
      text { fill: #e6edf3 }
      .small { fill: #9da7b1 }
    }
"""
DESCRIPTION = """Timing publishes the tick. The switcher grants the CAN bus to one payload node at a time by
  task flags. The payload nodes ask their peripherals over CAN. Every node publishes telemetry and events to ttc, which stores them, sends them to the ground over
  RS422 and publishes the ground's telecommands. ttc orders pictures from image_acquisition, whose frames image_processing searches; the products go down as files.
  Maintenance keeps the programs' versions and parameters. All nodes form a ring in which each checks the next."""


def box(kind, x, y, width, height, radius):
    return f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{height}" rx="{radius}"/>'


def text(kind, x, y, content):
    return f'<text class="{kind}" x="{x}" y="{y}">{content.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")}</text>'


def node(name):
    x, y, width, height, lines = NODES[name]
    middle = x + width // 2
    first = y + height // 2 + 5 - 8 * len(lines)
    parts = [box("node", x, y, width, height, 8), text("name", middle, first, name)]
    parts += [text("small", middle, first + 4 + 14 * (i + 1), line) for i, line in enumerate(lines)]
    return "".join(parts)


def device(x, y, width, height, name, line):
    middle = x + width // 2
    parts = [box("device", x, y, width, height, 4), text("name", middle, y + height // 2 + (0 if line else 5), name)]
    if line:
        parts.append(text("small", middle, y + height // 2 + 16, line))
    return "".join(parts)


def ring(names):
    """A strip of all nodes in the ring's order, and the way back from the last to the first."""
    parts = []
    for i, name in enumerate(names):
        x = RING_LEFT + RING_STEP * i
        parts.append(box("ring-node", x, RING_Y - 12, RING_STEP - 12, 24, 12) + text("ring-name", x + (RING_STEP - 12) // 2, RING_Y + 4, name))
        if i:
            parts.append(f'<path class="ring" d="M{x - 12},{RING_Y} H{x - 1}" marker-end="url(#ring-head)"/>')
    first, last = RING_LEFT + 40, RING_LEFT + RING_STEP * (len(names) - 1) + 40
    parts.append(f'<path class="ring" d="M{last},{RING_Y + 12} V{RING_Y + 24} H{first} V{RING_Y + 13}" marker-end="url(#ring-head)"/>')
    parts.append(text("small start", RING_LEFT, RING_Y - 20, "The liveness ring: each node checks the next ten times a second and restarts it when it does not answer."))
    return parts


def picture(names):
    """The SVG. @param names  the deployment's nodes, in the ring's order"""
    if sorted(names) != sorted(NODES):
        raise SystemExit(f"pictures.nodes: the deployment has {sorted(names)}, the drawing {sorted(NODES)}: change NODES")
    marker = '<marker id="{0}" viewBox="0 0 8 8" refX="7.5" refY="4" markerWidth="8" markerHeight="8" markerUnits="userSpaceOnUse" orient="auto-start-reverse"><path class="{0}" d="M0,0 L8,4 L0,8 z"/></marker>'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-labelledby="title desc" font-family="system-ui, \'DejaVu Sans\', Helvetica, Arial, sans-serif" font-size="13">',
        "<!-- Drawn by python/srfs/pictures/nodes.py. -->",
        '<title id="title">The nodes of SRFS and what flows between them</title>',
        f'<desc id="desc">{DESCRIPTION}</desc>',
        f"<style>\n{STYLE}</style>",
        "<defs>" + marker.format("head") + marker.format("ring-head") + "</defs>",
        box("panel", 0.5, 0.5, WIDTH - 1, HEIGHT - 1, 10),
        *(device(*d) for d in DEVICES),
        box("group", 806, 44, 182, 186, 10),
        *(node(name) for name in names),
    ]
    for path, both in FLOWS:
        start = ' marker-start="url(#head)"' if both else ""
        lines.append(f'<path class="flow" d="{path}"{start} marker-end="url(#head)"/>')
    lines += [text(*label) for label in LABELS]
    lines += ring(names)
    lines.append(text("small start", RING_LEFT, 30, "Blue: one process each. Every one of them sends telemetry and events to ttc."))
    return "\n".join([*lines, "</svg>", ""])


def deployed_nodes():
    return [entry["name"] for entry in deployments.read("sim")["nodes"]]


def make(bin_dir, folder, out):
    out.write_text(picture(deployed_nodes()))
