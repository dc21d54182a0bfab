# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs new`: what it writes and what it refuses. test_tutorials.py builds, tests and flies it, test_find_package.py builds it against an
installation; examples/tick_counter is built in the tree."""

import json
import shutil
import subprocess
from pathlib import Path

import yaml
from support import BIN, ROOT, SystemTest

EXAMPLE = ROOT / "examples" / "tick_counter"


def files_of(folder):
    return {str(p.relative_to(folder)): p.read_text() for p in sorted(Path(folder).rglob("*")) if p.is_file()}


class NewTest(SystemTest):
    def setUp(self):
        super().setUp()
        self.mine = self.folder / "mine"
        self.mine.mkdir()

    def new(self, *words, folder=None, cwd=None):
        command = [str(BIN / "srfs"), "new", *words, "--in", str(folder or self.mine), "--var", str(self.var), "--json"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, cwd=cwd or self.folder)
        return done.returncode, json.loads(done.stdout)

    def test_the_example_in_the_tree_is_what_it_writes(self):
        shutil.copytree(ROOT / "examples", self.mine, dirs_exist_ok=True, ignore=lambda _, names: {EXAMPLE.name} & set(names))
        (self.mine / "CMakeLists.txt").write_text("add_subdirectory(image_straylight)\n")
        for order in (("node", EXAMPLE.name), ("telecommand", "set_start")):
            code, answer = self.new(*order, folder=self.mine / EXAMPLE.name if order[0] == "telecommand" else self.mine)
            self.assertEqual((code, answer["ok"]), (0, True), answer)
        self.assertEqual(files_of(self.mine / EXAMPLE.name), files_of(EXAMPLE))
        self.assertEqual((self.mine / "CMakeLists.txt").read_text(), f"add_subdirectory(image_straylight)\nadd_subdirectory({EXAMPLE.name})\n")
        self.assertIn(f"cmake -S {self.mine} -B {self.mine}/build ", answer["next"][0])  # built with what is above

    def test_it_says_which_files_it_changed(self):
        (self.mine / "CMakeLists.txt").write_text("project(mine)\n")
        answer = self.new("node", "one")[1]
        self.assertEqual((answer["made"], answer["changed"]), ([], [str(self.mine / "CMakeLists.txt")]))
        self.assertEqual(answer["next"][-1].split()[-1], str(self.mine / "build/bin/one_node"))
        alone = self.folder / "alone"
        alone.mkdir()
        answer = self.new("node", "one", folder=alone)[1]
        self.assertEqual((answer["made"], answer["changed"]), ([], []))
        self.assertIn(f"cmake -S {alone}/one -B {alone}/one/build ", answer["next"][0])

    def test_each_new_node_has_numbers_of_its_own(self):
        answers = [self.new(*order)[1] for order in (("node", "one"), ("node", "two"), ("method", "three"))]
        self.assertEqual(len({answer["numbers"]["apid"] for answer in answers}), 3, answers)
        ids = [entry["id"] for answer in answers for key in ("structures", "events", "parameters")
               for entry in yaml.safe_load((Path(answer["folder"]) / "dictionary.yaml").read_text())[key]]  # fmt: skip
        self.assertEqual(len(set(ids)), 6, ids)  # events and parameters have the same numbers
        self.assertEqual({p.name for p in self.mine.iterdir()}, {"one", "two", "image_three"})
        for answer in answers:
            self.assertEqual(set(answer["files"]), set(files_of(answer["folder"])))

    def test_a_payload_makes_its_mission_or_becomes_a_part_of_it(self):
        mine = self.folder / "my_mission"
        first, second = (self.new("payload", name, folder=mine)[1] for name in ("one", "two"))
        self.assertEqual([answer["numbers"]["power_line"] for answer in (first, second)], [0, 1])
        self.check_mission(mine, mine / "sim.yaml", ["payload_one", "payload_two"])
        self.assertEqual(set(first["files"]), set(files_of(mine / "payload_one")))
        before = files_of(mine)
        self.assertEqual(self.new("payload", "one", folder=mine)[0], 1)
        self.assertEqual(files_of(mine), before)

        ours, deployment = self.folder / "mission", self.folder / "sim.yaml"
        shutil.copytree(ROOT / "mission", ours)
        shutil.copy(ROOT / "launch_config/sim.yaml", deployment)
        answer = self.new("payload", "three", "--deployment", str(deployment), folder=ours)[1]
        self.assertEqual(answer["numbers"]["can_address"], "0x21")
        self.check_mission(ours, deployment, ["payload_adcs", "payload_eps", "payload_thermal", "payload_three"])

    def test_a_payload_is_added_from_inside_of_its_mission(self):
        mine = self.folder / "my_mission"
        mine.mkdir()
        made = self.new("payload", "one", folder=".", cwd=mine)[1]
        self.assertEqual(made["made"], [str(mine / name) for name in ("CMakeLists.txt", "README.md", "mission.yaml", "sim.yaml")])
        self.assertEqual(made["changed"], [])
        self.assertLessEqual(len(files_of(mine)), 15, "a first payload with its mission")
        added = self.new("payload", "two", folder=".", cwd=mine)[1]
        self.assertEqual(added["changed"], [str(mine / name) for name in ("CMakeLists.txt", "mission.yaml", "sim.yaml")])
        self.check_mission(mine, mine / "sim.yaml", ["payload_one", "payload_two"])
        self.assertEqual({p.name for p in mine.iterdir()}, {"payload_one", "payload_two", *(Path(name).name for name in made["made"])})

    def test_a_misspelt_key_of_its_dictionary_ends_the_build_with_its_place(self):
        mine = self.folder / "my_mission"
        self.new("payload", "one", folder=mine)
        dictionary = mine / "payload_one/dictionary.yaml"
        right = dictionary.read_text()
        configure = ["cmake", "-S", mine, "-B", mine / "build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={BIN.parent}"]
        build = ["cmake", "--build", mine / "build", "--target", "my_mission_dictionary"]
        self.assertIn("unit:", right)
        dictionary.write_text(right.replace("unit:", "units:", 1))
        subprocess.run(configure, stdin=subprocess.DEVNULL, capture_output=True, check=True, timeout=300)
        wrong = subprocess.run(build, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
        self.assertNotEqual(wrong.returncode, 0, wrong.stdout)
        self.assertRegex(wrong.stdout + wrong.stderr, r"payload_one/dictionary\.yaml:[0-9]+: .*units': unknown key, expected one of")
        dictionary.write_text(right)
        subprocess.run(build, stdin=subprocess.DEVNULL, capture_output=True, check=True, timeout=300)

    def test_names_and_deployment_are_those_of_the_mission_it_is_for(self):
        mine = self.folder / "my_mission"
        for name in ("eps", "adcs"):  # SRFS' own mission has both
            self.assertEqual(self.new("payload", name, folder=mine)[0], 0)
        copy = mine / "build/share/my_mission"
        shutil.copytree(mine, copy, ignore=lambda *_: {"build"})
        (mine / "build/CMakeCache.txt").touch()
        built = files_of(copy)
        order = ("--deployment", str(copy / "sim.yaml"))
        answer = self.new("payload", "three", *order, folder=mine)[1]
        self.assertEqual(answer["numbers"]["deployment"], str(mine / "sim.yaml"))
        self.check_mission(mine, mine / "sim.yaml", ["payload_eps", "payload_adcs", "payload_three"])
        node = self.new("node", "four", folder=mine)[1]
        self.assertEqual(node["numbers"]["checked in the ring by"], "payload_three")
        self.assertEqual(self.new("telecommand", "go", folder=mine / "four")[0], 0)

        ours = self.folder / "mission"
        shutil.copytree(ROOT / "mission", ours)
        before = files_of(ours)
        self.assertIn("another mission", self.new("payload", "five", *order, folder=ours)[1]["error"])
        (copy / "other.yaml").write_text((ROOT / "launch_config/sim.yaml").read_text())
        self.assertIn("is a copy in", self.new("payload", "five", "--deployment", str(copy / "other.yaml"), folder=ours)[1]["error"])
        self.assertEqual((files_of(ours), {**files_of(copy), "other.yaml": ""}), (before, {**built, "other.yaml": ""}))

    def test_a_folder_that_cannot_become_a_mission_stays_as_it_is(self):
        for name, why in (("Bad-Name", "--in: the folder's name"), ("mine", "README.md is there already")):
            folder = self.folder / name
            folder.mkdir(exist_ok=True)
            (folder / "README.md").write_text("mine")
            code, answer = self.new("payload", "one", folder=folder)
            self.assertEqual(code, 1, answer)
            self.assertIn(why, answer["error"])
            self.assertEqual(files_of(folder), {"README.md": "mine"})
        code, answer = self.new("payload", "one", folder=self.mine / "README.md/mission")
        self.assertEqual((code, answer["ok"]), (1, False), answer)

    def test_an_interface_package_is_written_once_under_a_name_that_is_free(self):
        (self.mine / "CMakeLists.txt").write_text("project(mine)\n")
        code, answer = self.new("interfaces", "my_msgs")
        self.assertEqual((code, set(answer["files"])), (0, set(files_of(self.mine / "my_msgs"))), answer)
        self.assertEqual((self.mine / "CMakeLists.txt").read_text(), "project(mine)\n", "it is no part of the node's build")
        for name, why in (("my_msgs", "is there already"), ("srfs_msgs", "SRFS has a package"), ("Bad-Name", "lower-case")):
            code, answer = self.new("interfaces", name)
            self.assertEqual(code, 1, answer)
            self.assertIn(why, answer["error"])
        self.assertEqual({p.name for p in self.mine.iterdir()}, {"CMakeLists.txt", "my_msgs"})

    def check_mission(self, folder, deployment, payloads):
        mission = yaml.safe_load((folder / "mission.yaml").read_text())
        self.assertEqual(mission["payloads"], payloads)
        self.assertEqual(mission["include"], [f"{payload}/dictionary.yaml" for payload in payloads])
        for payload in payloads:
            self.assertIn(f"add_subdirectory({payload})\n", (folder / "CMakeLists.txt").read_text())
        plan = yaml.safe_load(deployment.read_text())
        self.assertEqual([slot["payload"] for slot in plan["slots"]], payloads)
        places = [node["peripheral"] for node in plan["nodes"] if "peripheral" in node] + plan.get("peripherals", [])
        for key in ("can_address", "power_line"):
            self.assertEqual(len({place[key] for place in places}), len(places), places)

    def test_what_does_not_fit_is_refused_and_nothing_is_written(self):
        (self.mine / "there").mkdir()
        (self.mine / "there/keep").write_text("mine")
        for order, why in (
            (("node", "Bad-Name"), "lower-case"),
            (("node", "class"), "reserved"),
            (("node", "payload_eps"), "already"),
            (("method", "processing"), "already"),  # image_processing
            (("node", "there"), "is there already"),
            (("method", "frame"), "its class would be Frame"),
            (("node", "octets"), "its class would be Octets"),
            (("node", "commanded"), "its class would be CommandedNode"),
            (("payload", "payload"), "its class would be PayloadProfile"),
            (("payload", "peripheral"), "its class would be PeripheralModel"),
        ):
            code, answer = self.new(*order)
            self.assertEqual((code, answer["ok"]), (1, False), answer)
            self.assertIn(why, answer["error"])
        self.assertEqual(files_of(self.mine), {"there/keep": "mine"})

    def test_what_does_not_fit_the_dictionary_is_refused_before_a_file_is_written(self):
        self.new("node", "one")
        fragment = self.mine / "one/dictionary.yaml"
        fragment.write_text(fragment.read_text().replace("one.counted", "two.counted"))
        before = files_of(self.mine)
        code, answer = self.new("node", "two")
        self.assertEqual(code, 1, answer)
        self.assertIn("two.counted", answer["error"])
        self.assertEqual(files_of(self.mine), before)
        self.assertEqual({p.name for p in self.mine.iterdir()}, {"one"})

        ours = self.folder / "mission"
        shutil.copytree(ROOT / "mission", ours)
        deployment = shutil.copy(ROOT / "launch_config/sim.yaml", self.folder)
        self.assertEqual(self.new("payload", "one", "--deployment", deployment, folder=ours)[0], 0)
        before = files_of(ours), Path(deployment).read_text()
        code, answer = self.new("payload", "two", "--deployment", deployment, folder=ours)  # SRFS' files leave ids for four
        self.assertEqual(code, 1, answer)
        self.assertIn("parameter_ids", answer["error"])
        self.assertEqual((files_of(ours), Path(deployment).read_text()), before)

    def test_a_telecommand_goes_only_where_it_has_a_place(self):
        self.assertEqual(self.new("node", "one")[0], 0)
        folder = self.mine / "one"
        self.assertEqual(self.new("telecommand", "go", folder=folder)[1]["numbers"], {"telecommand": "one.go", "function": 2})
        before = files_of(self.mine)
        for name, why in (("go", "already"), ("housekeeping", "another name"), ("clear", "already"), ("ticks", "member 'ticks_'")):
            code, answer = self.new("telecommand", name, folder=folder)
            self.assertEqual(code, 1, answer)
            self.assertIn(why, answer["error"])
        code, answer = self.new("telecommand", "go", folder=self.mine)
        self.assertEqual(code, 1, answer)

        mission = self.folder / "my_mission"
        payload = mission / "payload_one"
        self.new("payload", "one", folder=mission)
        for number, name in enumerate(("go", "stop"), start=2):
            answer = self.new("telecommand", name, folder=payload)[1]
            self.assertEqual(answer["numbers"], {"telecommand": f"one.{name}", "function": number, "peripheral_function": number})
            self.assertEqual(set(answer["files"]), {"dictionary.yaml", "one_profile.cpp", "one_model.cpp", "test/test_one.cpp"})
        of_mission = files_of(mission)
        for name, why in (("go", "already"), ("pulses", "member 'pulses_'"), ("Go", "lower-case")):
            code, answer = self.new("telecommand", name, folder=payload)
            self.assertEqual(code, 1, answer)
            self.assertIn(why, answer["error"])
        self.assertEqual(files_of(mission), of_mission)
        self.assertEqual(sorted(p.name for p in mission.iterdir() if p.name.startswith(".")), [])
        shutil.copytree(ROOT / "examples/image_straylight", self.folder / "method")
        code, answer = self.new("telecommand", "go", folder=self.folder / "method")
        self.assertIn("CommandSet", answer["error"])
        self.assertEqual(files_of(self.mine), before)
