"""Physical faults of a drive, played through the service, and a judge of what it then sends.

`rail` and `locomotive` make the truth by a wheel/rail law and a dynamics of their own, `sensors`
reads it as instruments do, `kinds` spoils it, `wire` packs frames with cantools' database. `judge`
reads the setpoints that come back, and the truth, and nothing else. None of it uses the service's
formulas; `play` alone touches its core, as a bus does.
"""
