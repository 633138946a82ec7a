"""Work on whole recordings without a service: checks, samples, traces and fit errors."""
