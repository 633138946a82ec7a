"""CAN in and out: databases, protection, codecs, recordings. Units are converted here alone."""
