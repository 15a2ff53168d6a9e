# differs: Scenic 3.1.1 checks requirements after the noise is added, the paper before
ego = new Object at (3, -4)
other = new Object at (20, 5)
mutate other by 3
require other.position.x > 20
