"""Report of a drive that the service went through: recorder, figures and page."""
