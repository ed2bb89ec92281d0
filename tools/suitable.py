"""Whether the interpreter that runs this file can serve: prints its version, such as ``3.12``, or says why not.

Old interpreters run it too, so it is written for any of them.
"""

import platform
import struct
import sys

VERSIONS = ((3, 11), (3, 12), (3, 13))  # those for which every pinned package has wheels; pyproject.toml says the same


def why_not():
    """One sentence, or None."""
    found = "this is %s %s" % (platform.python_implementation(), platform.python_version())
    known = ", ".join("%d.%d" % version for version in VERSIONS)
    if tuple(sys.version_info[:2]) not in VERSIONS or platform.python_implementation() != "CPython":
        return "this project runs on CPython %s; %s." % (known, found)
    if struct.calcsize("P") != 8:
        return "a 64-bit Python is needed; %s, 32-bit." % found
    if not getattr(sys, "_is_gil_enabled", lambda: True)():
        return "%s without the global interpreter lock, for which the packages are not built." % found
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError as error:
        return "%s without %s: install it (Debian: python3-venv)." % (found, error.name)
    return None


if __name__ == "__main__":
    reason = why_not()
    if reason is not None:
        sys.exit("%s: %s PYTHON=... chooses another." % (sys.executable, reason))
    sys.stdout.write("%d.%d\n" % tuple(sys.version_info[:2]))
