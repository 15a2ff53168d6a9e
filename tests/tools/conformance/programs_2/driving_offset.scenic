model scenic.domains.driving.model
ego = Car
Car offset by Range(-2, 2) @ Range(6, 10), facing roadDirection
