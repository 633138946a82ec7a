"""The next drive: the shortest manoeuvre that distinguishes the remaining explanations.

`explanations` lists what is left, `planned_drive` predicts what a plan would measure, `discrepancy`
how far a rival remains from that after it was fitted to it, `catalogue` has the manoeuvres,
`search` joins them, and `compute_next_drive` puts the plan and its sentence together. `remaining`
says which explanation is left once the plan was driven.
"""
