"""Vehicle speed observed from driven axles, for vehicles without a radar."""
