"""What a run leaves behind: report.json, log.npz and figures."""
