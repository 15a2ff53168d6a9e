# A car ahead in the same lane, at a distance that the ego covers in less than 2.5 seconds: with `--min-duration 5`
# intervals of that.
model scenic.domains.driving.model

ego = new Car
leader = new Car ahead of ego by (0, Range(1, 40)), facing Range(-5, 5) deg relative to ego.heading

require ego.speed > 1
require (distance to leader) < 2.5 * ego.speed
