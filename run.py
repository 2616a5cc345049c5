#!/usr/bin/env python3
"""Set up warpedfoam in its own virtual environment and run it, or run all its checks.

    python3 run.py foam [torus|sphere] [options]   the main job; writes to out/
    python3 run.py test [pytest options]           ruff, mypy, layers, tests, doctests, examples
    python3 run.py docs [sphinx options]           the documentation as a site: site/index.html
    python3 run.py gallery [names or groups]       draws the documentation's pictures anew (minutes)

Needs nothing but Python 3.11 or newer. Run it as often as you like: it installs again only when
pyproject.toml has changed. The environment is the folder .venv beside this file.
"""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile

OLDEST = (3, 11)
HERE = os.path.dirname(os.path.abspath(__file__))
VENV = os.path.join(HERE, ".venv")
BIN = os.path.join(VENV, "Scripts" if os.name == "nt" else "bin")
PYTHON = os.path.join(BIN, "python.exe" if os.name == "nt" else "python")
ORDER = ["--no-loadscope-reorder"]
STAMP = os.path.join(VENV, "warpedfoam-installed")


def say(text):
    """Print a line of our own on stderr, so that stdout stays the command's."""
    sys.stderr.write("run.py: " + text + "\n")
    sys.stderr.flush()


def fail(text):
    say(text)
    sys.exit(2)


def version_of(python):
    """(major, minor) of an interpreter, or None if it does not run."""
    try:
        out = subprocess.check_output(
            [python, "-c", "import sys; print('%d %d' % sys.version_info[:2])"], stderr=subprocess.DEVNULL
        )
        major, minor = out.split()
        return int(major), int(minor)
    except (OSError, ValueError, subprocess.CalledProcessError):
        return None


def use_new_enough_python():
    """Hand over to a newer interpreter if this one is too old; give up clearly if there is none."""
    if sys.version_info[:2] >= OLDEST:
        return
    wanted = "%d.%d" % OLDEST
    names = ["python3.%d" % minor for minor in range(OLDEST[1], OLDEST[1] + 8)]
    for name in ["python3", "python", *reversed(names)]:
        found = shutil.which(name)
        if found and (version_of(found) or (0, 0)) >= OLDEST:
            say("this is Python %d.%d; going on with %s" % (sys.version_info[0], sys.version_info[1], found))
            sys.exit(subprocess.call([found, os.path.abspath(__file__), *sys.argv[1:]]))
    fail(
        "warpedfoam needs Python %s or newer; this is Python %d.%d and no newer one was found. "
        "Install Python %s and run this again." % (wanted, sys.version_info[0], sys.version_info[1], wanted)
    )


def stamp_lines():
    try:
        with open(STAMP) as file:
            return file.read().splitlines()
    except OSError:
        return []


def make_environment():
    """Make .venv, or make it anew if its interpreter is gone or too old, or the folder was moved."""
    moved = stamp_lines()[:1] not in ([], [HERE])
    if not moved and (version_of(PYTHON) or (0, 0)) >= OLDEST:
        return
    say("making a virtual environment in .venv")
    if subprocess.call([sys.executable, "-m", "venv", "--clear", VENV], stdout=subprocess.DEVNULL) == 0:
        return
    # some systems ship Python without the pip that new environments get; our own pip can fill in
    made = subprocess.call([sys.executable, "-m", "venv", "--clear", "--without-pip", VENV])
    if made != 0 or importlib.util.find_spec("pip") is None:
        fail(
            "cannot make a virtual environment with %s. On Debian and Ubuntu install the package "
            "python3-venv, then run this again." % sys.executable
        )


def pip_command():
    if subprocess.call([PYTHON, "-c", "import pip"], stderr=subprocess.DEVNULL) == 0:
        return [PYTHON, "-m", "pip"]
    return [sys.executable, "-m", "pip", "--python", PYTHON]


def installed_for(extra):
    """What the stamp must say for an installation with this extra to be up to date."""
    with open(os.path.join(HERE, "pyproject.toml"), "rb") as file:
        return hashlib.sha256(file.read()).hexdigest() + extra


def install(extra=""):
    """Install the package in place with an extra, unless that has been done for this pyproject.toml."""
    make_environment()
    want, done = installed_for(extra), stamp_lines()
    if want in done or installed_for("[dev]") in done:  # which has all the others
        return
    say("installing warpedfoam%s and what it needs (once; takes a minute or two)" % extra)
    options = ["--quiet", "--disable-pip-version-check"]
    if extra == "[dev]":
        # tests import a small part of it, whose bytecode comes with the first import
        options.append("--no-compile")
    done = subprocess.call([*pip_command(), "install", *options, "--editable", HERE + extra])
    if done != 0:
        fail("the installation failed; see above. A connection to a package index is needed the first time.")
    with open(STAMP, "w") as file:
        file.write("\n".join([HERE, installed_for(""), want]) + "\n")


def tool(name):
    return os.path.join(BIN, name + (".exe" if os.name == "nt" else ""))


def foam(arguments):
    install()
    if not arguments or (arguments[0].startswith("-") and arguments[0] != "--help"):
        arguments = ["torus", *arguments]
    command = [tool("warpedfoam"), "foam", *arguments]
    if os.name != "nt":
        os.execv(command[0], command)  # so that Ctrl-C and kill reach the job itself
    return subprocess.call(command)


def test(arguments):
    """Types and layers are looked at beside the tests, some of which wait and leave a core idle."""
    install("[dev]")
    # a worker for each core, each with one thread for linear algebra; "-n 0" runs all in one process.
    # In their own order: by default files of few tests, some of which are long, would come last.
    pytest = [PYTHON, "-m", "pytest", "-n", "auto", "--dist", "loadfile", *ORDER, *arguments]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # tests start hundreds of interpreters: compiling everything anew would take each half a second more
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    slow = [("layers", [tool("lint-imports")]), ("mypy", [tool("mypy"), "--strict", "src"])]
    beside = [(name, *in_background(command)) for name, command in slow]
    failed = []
    for name, command in (("ruff", [tool("ruff"), "check", "."]), ("pytest", pytest)):
        say("--- " + name)
        if subprocess.call(command, cwd=HERE) != 0:
            failed.append(name)
    for name, process, output in beside:
        say("--- " + name)
        if process.wait() != 0:
            failed.append(name)
        with open(output, encoding="utf-8", errors="replace") as file:
            sys.stdout.write(file.read())
        sys.stdout.flush()
        os.remove(output)
    say("failed: " + ", ".join(failed) if failed else "all checks passed")
    return 1 if failed else 0


def in_background(command):
    """A process that takes the time that others leave, and the path of what it prints."""
    handle, output = tempfile.mkstemp()
    options = {} if os.name == "nt" else {"preexec_fn": lambda: os.nice(5)}
    process = subprocess.Popen(command, cwd=HERE, stdout=handle, stderr=subprocess.STDOUT, **options)
    os.close(handle)
    return process, output


def docs(arguments):
    """Warnings are errors. Pictures are those in docs/: "run.py gallery" draws them."""
    install("[docs]")
    pages, site = os.path.join(HERE, "docs"), os.path.join(HERE, "site")
    command = [PYTHON, "-m", "sphinx", "-W", "--keep-going", "-q", "-j", "auto", *arguments, pages, site]
    status = subprocess.call(command, cwd=HERE)
    if status == 0:
        say("the site is " + os.path.join(site, "index.html"))
    return status


def gallery(arguments):
    install("[docs,ensemble]")
    return subprocess.call([PYTHON, os.path.join(HERE, "docs", "drawing"), *arguments], cwd=HERE)


def main():
    use_new_enough_python()
    verbs = {"foam": foam, "test": test, "docs": docs, "gallery": gallery}
    if len(sys.argv) < 2 or sys.argv[1] not in verbs:
        sys.stderr.write(__doc__)
        return 0 if sys.argv[1:] in (["-h"], ["--help"]) else 2
    try:
        return verbs[sys.argv[1]](sys.argv[2:])
    except KeyboardInterrupt:
        say("interrupted")
        return 130


if __name__ == "__main__":
    sys.exit(main())
