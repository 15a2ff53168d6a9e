"""Plane geometry of scenes: angles, boxes, regions, vector fields and the road network.

Metres and radians; heading 0 points along +y and grows counter-clockwise. Regions and fields are values; what can be
asked of a region is a function: `membership` (contains, distance, bounds), `meeting` (meets, witness_point), `cells`
(triangles, convex_cells), `sampling` (sample).
"""
