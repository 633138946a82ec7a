"""Reference creep controller: efforts of the axles from speeds and the service's setpoints."""
