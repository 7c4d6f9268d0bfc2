"""What `make web` and `make engines` set up, with stand-ins for the programs that do it."""

import json
import os
import re
import shutil

import pytest

from tests.cli.helpers import ROOT
from tests.make_project import Project
from tests.web import browser, install

LOCK = ROOT / "tests" / "web" / "package-lock.json"
NODE = "echo v20.1.0"
NPM = 'echo "npm $*" >>"$LOG"; mkdir node_modules'
APT = """echo "apt-get $*" >>"$LOG"
case "$*" in *" install "*) echo >"$BIN/chromium"; chmod +x "$BIN/chromium";; esac"""


class Machine:
    """A machine that has stand-ins alone on its path."""

    def __init__(self, folder, monkeypatch):
        self.folder, self.bin, self.log = folder, folder / "bin", folder / "log"
        self.bin.mkdir()
        shutil.copy(LOCK, folder)
        for name in ("env", "mkdir", "rm", "chmod"):
            self.bin.joinpath(name).symlink_to(shutil.which(name))
        for name, value in (("PATH", self.bin), ("BIN", self.bin), ("LOG", self.log)):
            monkeypatch.setenv(name, str(value))
        monkeypatch.delenv("SHRM_CHROMIUM", raising=False)
        monkeypatch.setattr(browser, "HERE", folder)
        monkeypatch.setattr(browser, "MODULES", folder / "node_modules")

    def has(self, **programs):
        for name, script in programs.items():
            path = self.bin / name.replace("_", "-")
            path.write_text(f"#!/bin/sh\n{script}\n")
            path.chmod(0o755)
        return self

    def calls(self):
        """What was called since the last time."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        self.log.unlink(missing_ok=True)
        return lines


@pytest.fixture
def machine(tmp_path, monkeypatch):
    return Machine(tmp_path, monkeypatch)


@pytest.fixture
def user(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)


@pytest.fixture
def root(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 0)


def refused():
    """The line that says what is missing."""
    with pytest.raises(SystemExit) as found:
        install.main()
    line = str(found.value.code)
    assert line.startswith("Error: ")
    assert "\n" not in line
    return line


def test_a_machine_without_npm_is_told_what_to_install(machine, root):
    machine.has(apt_get=APT)
    assert "no npm on the path; install Node.js 18 or newer with npm" in refused()
    machine.has(npm=NPM)
    assert "no node on the path" in refused()
    machine.has(node="echo v12.22.9")
    assert "Node.js v12.22.9 is too old; install Node.js 18" in refused()
    assert machine.calls() == []


@pytest.mark.parametrize(
    "programs",
    [{}, {"apt_get": APT}, {"apt_get": APT, "sudo": "exit 1"}],
    ids=["no apt-get", "no sudo", "sudo asks for a password"],
)
def test_whoever_may_not_install_chromium_is_told_so(machine, user, programs):
    machine.has(npm=NPM, node=NODE, **programs)
    line = refused()
    assert "there is no Chromium on the path; install it (Debian: apt install chromium)" in line
    assert "SHRM_CHROMIUM" in line
    assert machine.calls() == []


def test_root_without_apt_is_told_so(machine, root):
    machine.has(npm=NPM, node=NODE)
    assert "there is no Chromium on the path; install it" in refused()


@pytest.mark.parametrize("who", ["root", "user"])
def test_chromium_and_the_engines_are_installed_once(machine, request, who):
    request.getfixturevalue(who)
    machine.has(npm=NPM, node=NODE, apt_get=APT)
    if who == "user":
        machine.has(sudo='shift; [ "$1" = true ] || exec "$@"')
    install.main()
    assert machine.calls() == [
        "apt-get --yes update",
        "apt-get --yes install --no-install-recommends chromium",
        "npm ci --ignore-scripts --no-audit --no-fund",
    ]
    assert browser.chromium() == str(machine.bin / "chromium")
    assert browser.complete()
    install.main()
    assert machine.calls() == []


def test_the_packages_alone_take_no_browser(machine, root):
    machine.has(npm=NPM, node=NODE, apt_get=APT)
    install.main("--packages")
    assert machine.calls() == ["npm ci --ignore-scripts --no-audit --no-fund"]


def test_another_lock_installs_the_engines_again(machine):
    machine.has(npm="rm -rf node_modules; " + NPM, node=NODE, google_chrome="")
    install.main()
    machine.folder.joinpath("package-lock.json").write_text("{}")
    assert not browser.complete()
    machine.calls()
    install.main()
    assert machine.calls() == ["npm ci --ignore-scripts --no-audit --no-fund"]
    assert browser.complete()


def test_what_fails_is_said_in_a_line(machine, root):
    machine.has(npm="mkdir node_modules; echo 'npm error code EAI' >&2; exit 1", node=NODE)
    machine.has(apt_get="echo 'E: Unable to locate package chromium' >&2; exit 100")
    assert "apt-get could not install Chromium (E: Unable to locate package chromium)" in refused()
    machine.has(chromium="")
    assert refused().endswith("packages of package-lock.json (npm error code EAI)")
    assert not browser.complete()


def test_a_named_browser_must_be_there(machine, monkeypatch, root):
    machine.has(npm=NPM, node=NODE, apt_get=APT)
    monkeypatch.setenv("SHRM_CHROMIUM", "/no/such/chrome")
    assert "SHRM_CHROMIUM: there is no program '/no/such/chrome'" in refused()
    monkeypatch.setenv("SHRM_CHROMIUM", "/bin/sh")
    install.main()
    assert browser.chromium() == "/bin/sh"


def test_the_engines_are_pinned_and_no_place_to_fetch_them_is():
    asked = json.loads(LOCK.with_name("package.json").read_text())["dependencies"]
    text = LOCK.read_text()
    packages = json.loads(text)["packages"]
    assert packages.pop("")["dependencies"] == asked
    for name, version in asked.items():
        assert re.fullmatch(r"\d+\.\d+\.\d+(-dev[.\d]+|-py\d+h\w+-\d)?", version), name
        assert packages[f"node_modules/{name}"]["version"] == version
    for name, package in packages.items():
        assert package["integrity"].startswith("sha512-"), name
        assert "resolved" not in package, name
    assert "registry" not in text


@pytest.mark.parametrize("target", ["web", "engines"])
def test_make_sets_up_first(tmp_path, target):
    project = Project(tmp_path)
    project.write(".venv/bin/python", '#!/bin/sh\necho "$SHRM_WEB $*" >>calls\n[ ! -e broken ]\n')
    project.folder.joinpath(".venv", "bin", "python").chmod(0o755)
    project.write("broken", "")
    assert project.make(target).returncode != 0
    assert project.calls() == [" -B -m tests.web.install"]
    project.folder.joinpath("broken").unlink()
    for times in range(2):
        assert project.make(target).returncode == 0
        first, *others, last = project.folder.joinpath("calls").read_text().splitlines()
        project.calls()
        assert first == " -B -m tests.web.install"
        installed = [line.split()[-1] for line in others if " pip install " in line]
        assert installed == [".[dev]", ".[web-test]"][2 * times :]
        run = {"web": "1 -m pytest tests/web", "engines": " -m tests.web.table"}
        assert last.startswith(run[target])


def test_make_browser_installs_no_browser(tmp_path):
    project = Project(tmp_path)
    project.write(".venv/bin/python", '#!/bin/sh\necho "$*" >>calls\n')
    project.folder.joinpath(".venv", "bin", "python").chmod(0o755)
    said = project.make("browser")
    assert (said.returncode, said.stdout, said.stderr) == (0, "", "")
    assert "-B -m tests.web.install --packages" in project.calls()
