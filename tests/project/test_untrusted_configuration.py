"""Tests that commands on a tree of another person run none of that person's code unless the user allows it."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.checks.configuration import configuration_for
from sar_compiler.project.trust import ConfigurationCode
from tests.trees import document

VALID = "tree.xml: no findings\n"
METADATA = {
    "METADATA": "Metadata-Version: 2.1\nName: {name}\nVersion: 1\n",
    "entry_points.txt": "[sar_compiler.nodes]\ngripper = gripper\n",
}


def pretend_to_be_installed(folder, name="gripper", suffix="dist-info"):
    metadata = folder / f"{name}-1.{suffix}"
    metadata.mkdir(parents=True)
    for file, text in METADATA.items():
        wanted = "PKG-INFO" if file == "METADATA" and suffix == "egg-info" else file
        (metadata / wanted).write_text(text.format(name=name), encoding="utf-8")
    return metadata


@pytest.fixture
def checkout_with_nodes(checkout):
    """Return a checkout whose configuration names a module of leaves in the checkout."""
    checkout.write_leaves()
    checkout.configure('nodes = ["gripper"]\n')
    return checkout


class TestModulesNamedByConfiguration:
    def test_modules_in_checkout_are_not_imported(self, checkout_with_nodes):
        said = checkout_with_nodes.validate()
        assert (
            "sar.toml:1:11: error[untrusted-nodes]: the module 'gripper' is not trusted, because no installed package registers it"
            in said
        )
        assert "--nodes gripper" in said
        assert "--trust" in said
        assert "unknown-node" not in said
        assert not checkout_with_nodes.has_run

    def test_error_shows_options_with_which_command_succeeds(self, checkout_with_nodes):
        said = checkout_with_nodes.validate()
        options = re.search(r"add ((?:--nodes [\w.]+ ?)+) ?to the command, or first install", said)
        assert options is not None, said
        assert "untrusted-nodes" not in checkout_with_nodes.validate(*options[1].split())
        assert checkout_with_nodes.has_run

    @pytest.mark.parametrize("command", ["show", "simulate", "verify"])
    def test_no_command_imports_untrusted_modules(self, checkout_with_nodes, command):
        done = checkout_with_nodes.command(command, "tree.xml")
        assert done.returncode != 0
        assert "untrusted-nodes" in done.stderr
        assert not checkout_with_nodes.has_run

    @pytest.mark.parametrize("path", ["", ".", ":{folder}", "{folder}"])
    def test_untrusted_modules_are_not_imported_from_any_pythonpath(self, checkout_with_nodes, path):
        said = checkout_with_nodes.validate(PYTHONPATH=path.format(folder=checkout_with_nodes.folder))
        assert "untrusted-nodes" in said
        assert not checkout_with_nodes.has_run

    @pytest.mark.parametrize("above", [1, 2])
    @pytest.mark.parametrize("package", [True, False])
    def test_modules_of_package_that_contains_checkout_are_not_imported(
        self, checkout_with_nodes, above, package
    ):
        """For example, `PYTHONPATH` contains the folder with all checkouts of a user."""
        if package:
            checkout_with_nodes.write("__init__.py", "")
        folders = [checkout_with_nodes.folder, *checkout_with_nodes.folder.parents]
        module = ".".join([*(folder.name for folder in reversed(folders[:above])), "gripper"])
        checkout_with_nodes.configure(f'nodes = ["{module}"]\n')
        said = checkout_with_nodes.validate(PYTHONPATH=str(folders[above]))
        assert "untrusted-nodes" in said
        assert not checkout_with_nodes.has_run

    def test_installed_modules_above_trees_are_imported(self, checkout_with_nodes, tmp_path):
        """For example, `pip install --target` has installed a package together with its trees."""
        site = tmp_path / "site"
        (site / "robot").mkdir(parents=True)
        shutil.move(checkout_with_nodes.folder, site / "robot" / "trees")
        shutil.move(site / "robot" / "trees" / "gripper.py", site / "robot")
        checkout_with_nodes.folder = site / "robot" / "trees"
        checkout_with_nodes.configure('nodes = ["robot.gripper"]\n')
        metadata = pretend_to_be_installed(site)
        (metadata / "entry_points.txt").write_text(
            "[sar_compiler.nodes]\ng = robot.gripper\n", encoding="utf-8"
        )
        assert checkout_with_nodes.validate(PYTHONPATH=str(site)) == VALID

    @pytest.mark.parametrize("question", [["nodes", "Grip"], ["schema"], ["schema", "--format", "json"]])
    def test_nodes_and_schema_commands_report_untrusted_modules(self, checkout_with_nodes, question):
        done = checkout_with_nodes.command(*question)
        assert (done.returncode, done.stdout) == (1, "")
        assert "sar.toml:1:11: error[untrusted-nodes]" in done.stderr
        assert not checkout_with_nodes.has_run
        done = checkout_with_nodes.command(*question, "--trust")
        assert done.returncode == 0
        assert "Grip" in done.stdout

    def test_modules_in_current_folder_are_not_imported(self, checkout_with_nodes, tmp_path):
        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        shutil.move(checkout_with_nodes.folder / "gripper.py", elsewhere / "gripper.py")
        checkout_with_nodes.write_leaves("gripper.py").unlink()
        tree = checkout_with_nodes.folder / "tree.xml"
        checkout_with_nodes.folder = elsewhere
        done = checkout_with_nodes.command("validate", tree, PYTHONPATH=os.pathsep)
        assert "untrusted-nodes" in done.stdout
        assert not checkout_with_nodes.has_run

    def test_modules_named_by_user_are_imported(self, checkout_with_nodes):
        assert checkout_with_nodes.validate("--nodes", "gripper") == VALID
        assert checkout_with_nodes.has_run

    def test_installed_modules_are_imported(self, checkout_with_nodes, tmp_path):
        site = tmp_path / "site"
        site.mkdir()
        shutil.move(checkout_with_nodes.folder / "gripper.py", site)
        assert "untrusted-nodes" in checkout_with_nodes.validate(PYTHONPATH=str(site))
        pretend_to_be_installed(site)
        assert checkout_with_nodes.validate(PYTHONPATH=str(site)) == VALID

    def test_installed_module_takes_precedence_over_module_in_checkout(self, checkout_with_nodes, tmp_path):
        site = tmp_path / "site"
        site.mkdir()
        (site / "gripper.py").write_text(
            (checkout_with_nodes.folder / "gripper.py")
            .read_text("utf-8")
            .replace("it has run", "the installed one has run")
        )
        pretend_to_be_installed(site)
        assert checkout_with_nodes.validate(PYTHONPATH=os.pathsep.join(["", str(site)])) == VALID
        assert checkout_with_nodes.proof.read_text("utf-8") == "the installed one has run"

    def test_trusted_modules_are_found_beside_linked_configuration(self, checkout_with_nodes, tmp_path):
        shutil.move(checkout_with_nodes.folder / "sar.toml", tmp_path / "sar.toml")
        (checkout_with_nodes.folder / "sar.toml").symlink_to(tmp_path / "sar.toml")
        assert "untrusted-nodes" in checkout_with_nodes.validate(PYTHONPATH=str(checkout_with_nodes.folder))
        assert checkout_with_nodes.validate("--trust") == VALID

    @pytest.mark.parametrize(
        "module",
        [
            "antigravity",
            "test.autotest",
            "test.crashers.gc_inspection",
            "pytest",
            "py_trees",
            "gripper/../x",
            "",
            "gripper.py",
        ],
    )
    def test_installed_modules_of_packages_without_leaves_are_not_imported(self, checkout, module):
        checkout.configure(f'nodes = ["{module}"]\n')
        said = checkout.validate()
        assert (
            f"untrusted-nodes]: the module '{module}' is not trusted, because no installed package registers it"
            in said
        )

    def test_modules_of_unregistered_part_of_namespace_package_are_not_imported(
        self, checkout_with_nodes, tmp_path
    ):
        site = tmp_path / "site"
        for part in ("mine", "others"):
            (site / "acme" / part).mkdir(parents=True)
            shutil.copy(checkout_with_nodes.folder / "gripper.py", site / "acme" / part / "gripper.py")
        metadata = pretend_to_be_installed(site)
        (metadata / "entry_points.txt").write_text(
            "[sar_compiler.nodes]\ng = acme.mine.gripper\n", encoding="utf-8"
        )
        checkout_with_nodes.configure('nodes = ["acme.others.gripper"]\n')
        assert "untrusted-nodes" in checkout_with_nodes.validate(PYTHONPATH=str(site))
        checkout_with_nodes.configure('nodes = ["acme.mine.gripper"]\n')
        assert checkout_with_nodes.validate(PYTHONPATH=str(site)) == VALID

    def test_all_untrusted_modules_are_reported_at_once(self, checkout_with_nodes):
        checkout_with_nodes.configure('nodes = ["gripper", "arm"]\n')
        assert checkout_with_nodes.validate().count("error[untrusted-nodes]") == 2


class TestTrust:
    def test_trust_imports_modules_beside_configuration_and_is_recorded(self, checkout_with_nodes):
        assert checkout_with_nodes.validate("--trust") == VALID
        assert checkout_with_nodes.validate() == VALID
        (record,) = (checkout_with_nodes.home / "state/sar_compiler/trusted").iterdir()
        assert record.read_text("utf-8") == f"{checkout_with_nodes.folder / 'sar.toml'}\n"

    def test_trust_is_stored_in_home_folder_by_default(self, checkout_with_nodes):
        assert checkout_with_nodes.validate("--trust", XDG_STATE_HOME="relative") == VALID
        assert len(list((checkout_with_nodes.home / ".local/state/sar_compiler/trusted").iterdir())) == 1

    def test_trust_is_lost_when_module_changes(self, checkout_with_nodes):
        checkout_with_nodes.validate("--trust")
        checkout_with_nodes.proof.unlink()
        checkout_with_nodes.write(
            "gripper.py", (checkout_with_nodes.folder / "gripper.py").read_text("utf-8") + "\n"
        )
        assert "untrusted-nodes" in checkout_with_nodes.validate()
        assert not checkout_with_nodes.has_run

    def test_trust_is_lost_when_configuration_changes(self, checkout_with_nodes):
        checkout_with_nodes.validate("--trust")
        checkout_with_nodes.configure('nodes = ["gripper"]\n\n')
        assert "untrusted-nodes" in checkout_with_nodes.validate()

    def test_trust_is_lost_when_checkout_is_moved(self, checkout_with_nodes):
        checkout_with_nodes.validate("--trust")
        checkout_with_nodes.folder = checkout_with_nodes.folder.rename(
            checkout_with_nodes.folder.parent / "moved"
        )
        assert "untrusted-nodes" in checkout_with_nodes.validate()

    def test_trust_is_lost_when_any_module_of_package_changes(self, checkout):
        checkout.write("robot/__init__.py", "from robot.inner.leaves import Grip\n")
        checkout.write("robot/inner/helper.py", "")
        checkout.write_leaves("robot/inner/leaves.py")
        checkout.configure('nodes = ["robot"]\n')
        assert checkout.validate("--trust") == VALID
        assert checkout.validate() == VALID
        checkout.write("robot/inner/helper.py", "import os\n")
        assert "untrusted-nodes" in checkout.validate()

    def test_trust_is_not_lost_when_bytecode_changes(self, checkout):
        checkout.write_leaves("gripper/__init__.py")
        checkout.configure('nodes = ["gripper"]\n')
        checkout.validate("--nodes", "gripper")
        assert (checkout.folder / "gripper/__pycache__").exists()
        assert checkout.validate("--trust") == VALID
        shutil.rmtree(checkout.folder / "gripper/__pycache__")
        assert checkout.validate() == VALID

    def test_trusted_module_is_run_from_source_and_not_from_bytecode(self, checkout):
        package = checkout.write(
            "robot/__init__.py", "import robot.leaves\nfrom robot.leaves import Grip\n"
        ).parent
        leaves = checkout.write_leaves("robot/leaves.py")
        good = leaves.read_bytes()
        evil = good.replace(b"it has run", b"it is evil")
        checkout.configure('nodes = ["robot"]\n')
        # The bytecode comes from another source of the same size and modification time.
        leaves.write_bytes(evil)
        moment = leaves.stat().st_mtime_ns
        done = checkout.command("validate", "tree.xml", "--nodes", "robot")
        assert done.returncode == 0
        assert list(package.glob("__pycache__/leaves.*"))
        leaves.write_bytes(good)
        os.utime(leaves, ns=(moment, moment))
        assert checkout.validate("--trust") == VALID
        assert checkout.proof.read_text("utf-8") == "it has run"

    def test_trust_does_not_extend_to_modules_that_are_not_named(self, checkout):
        checkout.write_leaves("helper.py")
        checkout.write("robot.py", "from helper import Grip\n")
        checkout.configure('nodes = ["robot"]\n')
        done = checkout.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "No module named 'helper'" in done.stderr
        assert not checkout.has_run

    @pytest.mark.parametrize("link", ["robot", "robot/inner"])
    def test_trust_does_not_extend_to_linked_files(self, checkout, tmp_path, link):
        outside = tmp_path / "outside"
        outside.mkdir()
        (checkout.folder / "robot").mkdir()
        shutil.move(checkout.write_leaves("leaves.py"), outside / "leaves.py")
        if link == "robot":
            (checkout.folder / "robot").rmdir()
        (checkout.folder / link).symlink_to(outside)
        module = f"{link.replace('/', '.')}.leaves"
        checkout.configure(f'nodes = ["{module}"]\n')
        done = checkout.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "is not part of the trusted code" in done.stderr
        assert not checkout.has_run

    @pytest.mark.parametrize("is_link", [False, True])
    def test_module_replaced_after_hashing_is_not_imported(self, tmp_path, monkeypatch, is_link):
        monkeypatch.setattr(sys, "meta_path", [*sys.meta_path])
        (tmp_path / "exchanged_gripper.py").write_text("VALUE = 'trusted'\n", encoding="utf-8")
        (tmp_path / "sar.toml").write_text("", encoding="utf-8")
        content = ConfigurationCode.from_configuration(tmp_path / "sar.toml", ["exchanged_gripper"])
        content.make_importable()
        evil = "raise SystemExit('it has run')\n"
        if is_link:
            (tmp_path / "evil.py").write_text(evil, encoding="utf-8")
            (tmp_path / "exchanged_gripper.py").unlink()
            (tmp_path / "exchanged_gripper.py").symlink_to("evil.py")
        else:
            (tmp_path / "exchanged_gripper.py").write_text(evil, encoding="utf-8")
        with pytest.raises(ImportError, match=r"exchanged_gripper\.py has changed since it was trusted"):
            importlib.import_module("exchanged_gripper")

    def test_trust_that_cannot_be_recorded_is_an_error(self, checkout_with_nodes):
        (checkout_with_nodes.home / "state").write_text("a file")
        done = checkout_with_nodes.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "cannot record that" in done.stderr
        assert not checkout_with_nodes.has_run


class TestModulesNamedLikeLibraries:
    @pytest.mark.parametrize("path", [":{elsewhere}", "{elsewhere}:", ".:{elsewhere}", "{folder}"])
    @pytest.mark.parametrize("library", ["jsonschema", "json"])
    def test_modules_in_checkout_do_not_shadow_libraries(self, checkout, tmp_path, library, path):
        """The `PYTHONPATH` of a workspace often ends with an empty part, which stands for the current folder."""
        checkout.write_leaves(f"{library}.py")
        checkout.configure('[findings]\nunused-port = "off"\n')
        variable = path.format(elsewhere=tmp_path / "elsewhere", folder=checkout.folder)
        checkout.validate(PYTHONPATH=variable)
        assert not checkout.has_run

    def test_module_named_by_user_is_found_by_relative_pythonpath(self, checkout):
        shutil.move(checkout.write_leaves(), checkout.write("src/here.txt", "").parent)
        assert checkout.validate("--nodes", "gripper", PYTHONPATH="src") == VALID
        assert checkout.has_run


class TestEntryPoints:
    @pytest.mark.parametrize("suffix", ["dist-info", "egg-info"])
    def test_entry_points_of_metadata_in_checkout_are_ignored(self, checkout, suffix):
        checkout.write_leaves()
        pretend_to_be_installed(checkout.folder, suffix=suffix)
        done = checkout.command("validate", "tree.xml", PYTHONPATH="")
        said = checkout.validate(PYTHONPATH=os.pathsep)
        assert done.returncode == 1
        assert "unknown-node" in said
        assert f"note: the leaves of 'gripper' are ignored: {checkout.folder} declares" in said
        assert not checkout.has_run

    def test_entry_points_below_checkout_are_ignored(self, checkout):
        checkout.write_leaves("lib/gripper.py")
        pretend_to_be_installed(checkout.folder / "lib")
        assert "are ignored" in checkout.validate(PYTHONPATH=str(checkout.folder / "lib"))
        assert not checkout.has_run

    def test_entry_points_on_relative_path_are_ignored(self, checkout, tmp_path):
        elsewhere = tmp_path / "elsewhere"
        pretend_to_be_installed(elsewhere / "lib")
        shutil.move(checkout.write_leaves(), elsewhere / "lib")
        tree, checkout.folder = checkout.folder / "tree.xml", elsewhere
        assert "are ignored" in checkout.command("validate", tree, PYTHONPATH="lib").stderr
        assert not checkout.has_run

    def test_palette_entry_points_are_not_imported_for_hint(self, checkout):
        """The unknown tag is in a subfolder of the checkout, and `PYTHONPATH` contains the checkout."""
        checkout.write_leaves()
        metadata = pretend_to_be_installed(checkout.folder)
        (metadata / "entry_points.txt").write_text("[sar_compiler.palettes]\ngripper = gripper\n")
        checkout.write("trees/tree.xml", document("<RecoveryNode/>"))
        root, checkout.folder = checkout.folder, checkout.folder / "trees"
        said = checkout.validate(PYTHONPATH=str(root))
        assert "add a palette that describes it: --model nav2:jazzy" in said
        assert not checkout.has_run

    def test_entry_points_in_checkout_do_not_replace_installed_ones(self, checkout):
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        metadata = pretend_to_be_installed(checkout.folder, "sar_compiler")
        (metadata / "entry_points.txt").write_text("[sar_compiler.nodes]\n", encoding="utf-8")
        assert checkout.validate(PYTHONPATH=os.pathsep) == VALID

    def test_entry_points_file_that_is_pipe_does_not_block(self, checkout):
        metadata = pretend_to_be_installed(checkout.folder, "sar_compiler")
        (metadata / "entry_points.txt").unlink()
        os.mkfifo(metadata / "entry_points.txt")
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        assert checkout.validate(PYTHONPATH=os.pathsep) == VALID

    def test_entry_points_of_packages_installed_elsewhere_are_used(self, checkout, tmp_path):
        site = tmp_path / "site"
        pretend_to_be_installed(site)
        shutil.move(checkout.write_leaves(), site)
        assert checkout.validate(PYTHONPATH=str(site)) == VALID

    def test_entry_points_of_sourced_workspace_are_used_even_in_checkout(self, checkout):
        checkout.write_leaves("install/lib/gripper.py")
        pretend_to_be_installed(checkout.folder / "install" / "lib")
        prefix = checkout.folder / "install"
        assert checkout.validate(PYTHONPATH=str(prefix / "lib"), AMENT_PREFIX_PATH=str(prefix)) == VALID

    def test_entry_points_of_editable_install_are_used(self, checkout, tmp_path):
        """After `pip install -e .`, the metadata is elsewhere and the code is in the checkout."""
        site = tmp_path / "site"
        metadata = pretend_to_be_installed(site)
        (metadata / "direct_url.json").write_text(
            f'{{"url": "{checkout.folder.as_uri()}", "dir_info": {{"editable": true}}}}', encoding="utf-8"
        )
        checkout.write_leaves("src/gripper.py")
        path = os.pathsep.join([str(checkout.folder / "src"), str(site)])
        assert checkout.validate(PYTHONPATH=path) == VALID

    def test_entry_point_imports_installed_module_and_not_one_in_checkout(self, checkout, tmp_path):
        site = tmp_path / "site"
        pretend_to_be_installed(site)
        leaves = checkout.write_leaves()
        (site / "gripper.py").write_text(leaves.read_text("utf-8").replace("it has run", "the installed one"))
        path = os.pathsep.join(["", str(site)])
        assert checkout.validate(PYTHONPATH=path) == VALID
        assert checkout.proof.read_text("utf-8") == "the installed one"

    @pytest.mark.parametrize("text", ["not JSON", "[]", '{"url": "file:///"}'])
    def test_entry_points_with_invalid_direct_url_are_used(self, checkout, tmp_path, text):
        site = tmp_path / "site"
        (pretend_to_be_installed(site) / "direct_url.json").write_text(text, encoding="utf-8")
        shutil.move(checkout.write_leaves(), site)
        assert checkout.validate(PYTHONPATH=str(site)) == VALID


class TestFilesThatConfigurationMayName:
    def test_palette_linked_from_outside_is_not_read(self, checkout, tmp_path):
        secret = tmp_path / "secret.xml"
        secret.write_text("<secret/>", encoding="utf-8")
        (checkout.folder / "nodes.xml").symlink_to(secret)
        checkout.configure('models = ["nodes.xml"]\n')
        said = checkout.validate()
        assert "error[setting-outside]: models: 'nodes.xml' is outside" in said
        assert "<secret" not in said

    @pytest.mark.parametrize("command", ["validate", "simulate", "show"])
    @pytest.mark.parametrize(
        ("palette", "said"),
        [
            ("nav2:jazy", "there is no palette 'nav2:jazy', did you mean 'nav2:jazzy'?"),
            ("griper:1", "there is no palette 'griper:1' (installed: nav2:"),
            ("nodes.xml", "cannot read"),
        ],
    )
    def test_missing_palette_is_reported_in_configuration(self, checkout, command, palette, said):
        checkout.configure(f'models = [\n  "{palette}",\n]\n')
        done = checkout.command(command, "tree.xml")
        assert done.returncode != 0
        assert f"sar.toml:2:4: error[setting-not-found]: {said}" in done.stdout + done.stderr

    def test_configuration_outside_repository_may_only_name_its_own_folder(self, checkout):
        (checkout.folder / ".git").rmdir()
        (checkout.folder.parent / "shared").mkdir()
        checkout.configure('include-path = ["../shared"]\n')
        assert "error[setting-outside]: include-path: '../shared'" in checkout.validate()

    def test_options_may_name_files_outside_repository(self, checkout, tmp_path):
        palette = tmp_path / "nodes.xml"
        palette.write_text(
            '<root><TreeNodesModel><Action ID="Grip"/></TreeNodesModel></root>', encoding="utf-8"
        )
        assert checkout.validate("--model", str(palette)) == VALID


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root gives files away")
class TestConfigurationOfOtherOwner:
    def test_configuration_of_other_owner_is_ignored_with_note(self, checkout):
        os.chown(checkout.configure("not even TOML"), 1234, 1234)
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        done = checkout.command("validate", "tree.xml")
        assert done.stdout == VALID
        assert done.stderr == (
            f"note: {checkout.folder / 'sar.toml'} is ignored, because this file belongs neither to you nor to the owner of "
            "tree.xml\n"
        )

    def test_configuration_applies_to_tree_of_same_owner(self, checkout):
        for path in (checkout.configure("x = 1\n"), checkout.folder / "tree.xml"):
            os.chown(path, 1234, 1234)
        assert "unknown-key" in checkout.validate()

    def test_next_configuration_above_ignored_one_applies(self, checkout):
        checkout.configure("x = 1\n")
        checkout.write("trees/tree.xml", document("<NavigateToBase/>"))
        os.chown(checkout.write("trees/pyproject.toml", "[tool.sar]\ny = 1\n"), 1234, 1234)
        done = checkout.command("validate", "trees/tree.xml")
        assert done.stdout.startswith("sar.toml:1:1: error[unknown-key]")
        assert f"{checkout.folder}/trees/pyproject.toml is ignored" in done.stderr

    @pytest.mark.parametrize("owner", [0, 1235])
    def test_configuration_of_user_or_root_applies_to_tree_of_other_owner(self, checkout, monkeypatch, owner):
        tree = checkout.folder / "tree.xml"
        os.chown(tree, 1234, 1234)
        os.chown(checkout.configure('nodes = ["a"]\n'), owner, owner)
        monkeypatch.setattr(os, "geteuid", lambda: 1235)
        assert configuration_for(tree).nodes == ("a",)


def test_entry_points_are_found_if_current_folder_was_deleted(checkout):
    """The current folder may have been deleted."""
    gone = checkout.folder.parent / "gone"
    gone.mkdir()
    tree = checkout.write("tree.xml", document("<NavigateToBase/>"))
    program = (
        f"import os, sys; os.chdir({str(gone)!r}); os.rmdir({str(gone)!r}); "
        f"from sar_compiler.nodes.installed import entry_points; "
        f"from pathlib import Path; print(len(entry_points('sar_compiler.nodes', Path({str(tree.parent)!r}))))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("1\n", "")
    assert Path(tree).exists()
