"""FMUs for co-simulation (FMI 2.0): service, locomotive and creep controller in other tools.

    slaves:   service.py, locomotive.py, controller.py   plain classes, no word of FMI in them
    the file: description.py, library.py, export.py      XML, compiled library, archive
    at work:  source/*.c ─ a socket or two pipes ─ child.py, session.py ─ a slave

The library of an FMU is small, knows nothing of adhesion, and starts a Python process.
"""
