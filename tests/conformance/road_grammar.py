"""What programs of the driving world may be made of: for each kind of expression the forms that it takes.

A form is text with holes. `{angle}` is any angle, `{number:2:9}` a number that lies about there, `{car}` a car that the
program has made. `road_programs` fills the holes.
"""

from __future__ import annotations

__all__ = ["ENDS", "FORMS", "SPECIFIERS"]

ENDS: dict[str, tuple[str, ...]] = {
    "number": (
        "{constant}", "{constant}", "Range({low}, {high})", "Range({low}, {high})", "Range({high}, {low})",
        "{hidden}", "{hidden}",
    ),
    "angle": (
        "{number:-180:180} deg", "{number:-60:60} deg", "{oriented}.heading", "{rad}",
    ),
    "bearing": (
        "{angle}", "{angle}", "{oriented}.heading", "{oriented}.orientation",
    ),
    "vector": (
        "{place}", "{thing}.position", "{thing}.position", "Vector{beside}", "Vector{place}", "{beside}",
    ),
    "located": (
        "{thing}.position", "Vector{place}", "Vector{beside}", "{oriented}.position",
    ),
    "pair": (
        "({number:-6:6}, {number:2:20})", "({constant:-5:5}, {number:-15:15})",
        "Vector({number:-4:4}, {number:1:9})", "({number:-6:6} @ {number:-20:20})",
    ),
    "field": (
        "roadDirection", "roadDirection", "network.roadDirection", "{lane}.orientation",
    ),
    "lane": (
        "network.lanes[{nth lanes}]", "Uniform(*network.lanes)", "{car}.lane", "network.laneAt({place})",
        "network.laneAt({car})", "{some lanes}",
    ),
    "section": (
        "network.laneSections[{nth laneSections}]", "Uniform(*network.laneSections)", "{car}.laneSection",
        "network.laneSectionAt({place})",
    ),
    "group": (
        "network.laneGroups[{nth laneGroups}]", "Uniform(*network.laneGroups)", "{car}.laneGroup",
        "network.laneGroupAt({place})",
    ),
    "street": (
        "network.roads[{nth roads}]", "Uniform(*network.roads)", "{car}.road", "network.roadAt({place})",
    ),
    "crossing": (
        "network.intersections[{nth intersections}]", "Uniform(*network.intersections)",
        "Uniform(*filter(lambda i: i.is3Way, network.intersections))",
        "Uniform(*[i for i in network.intersections if not i.isSignalized])",
        "Uniform(*filter(lambda i: i.is4Way or i.is3Way, network.intersections))",
    ),
    "turn": (
        "Uniform(*network.intersections[{nth intersections}].maneuvers)", "Uniform(*{nearlane}.maneuvers)",
        "network.intersections[{nth intersections}].maneuvers[0]",
        "Uniform(*filter(lambda m: m.type is ManeuverType.LEFT_TURN, {crossing0}.maneuvers))",
        "Uniform(*filter(lambda m: m.type is not ManeuverType.STRAIGHT, {crossing0}.maneuvers))",
    ),
    "region": (
        "road", "intersection", "{lane}", "{lane}", "{group}", "{street}", "{section}", "{crossing}",
        "CircularRegion({vector}, {constant:2:15})", "{lane}.centerline", "roadOrShoulder", "curb",
    ),
    "area": (
        "CircularRegion({place}, {constant:4:30})",
        "RectangularRegion({place}, {constant:-90:90} deg, {constant:5:25}, {constant:5:30})",
        "PolygonalRegion([{place+0+0}, {place+9+0}, {place+7+8}, {place-2+12}])",
        "SectorRegion(Vector{place}, {constant:5:40}, {constant:-180:180} deg, {constant:30:200} deg)",
    ),
    "condition": (
        "(distance from {thing} to {thing}) < {constant:30:120}", "(distance to {other}) > {constant:1:9}",
        "{car} in road", "{car} can see {object}", "{thing}.position.x {compare} {x}",
        "{object}.width < {constant:2:9}", "abs(relative heading of {oriented}) < {constant:60:170} deg",
        "(relative heading of {oriented} from {oriented}) > {constant:-150:0} deg",
        "abs(apparent heading of {oriented}) < {constant:90:175} deg",
        "abs(angle to {other}) < {constant:90:175} deg", "{hidden} {compare} {constant}",
    ),
}  # fmt: skip
"""Forms that end what is nested."""

FORMS: dict[str, tuple[str, ...]] = {
    "number": (
        "Normal({middle}, {deviation})", "TruncatedNormal({middle}, {deviation}, {low}, {high})",
        "DiscreteRange({whole low}, {whole high})", "Uniform({constant}, {constant}, {constant})",
        "Discrete({{{low}: 2, {middle}: 1, {high}: 3}})", "Uniform(*[{constant}, {constant}])",
        "Uniform({low}, Range({low}, {high}))", "Uniform(Range({low}, {middle}), Range({middle}, {high}))",
        "Range({low}, {high}) + {constant:-1:1}", "({number} + {number}) / 2", "abs({number})", "-({number})",
        "min({number}, {high})", "max({number}, {low})", "{constant:0.4:1.2} * ({number})",
        "{hidden} + {constant:-2:2}", "(distance from {thing} to {place}) / {constant:4:12}",
        "(distance to {other}) / {constant:5:12}", "{object}.width + {constant}",
        "{object}.length * {constant:0.3:1}", "{function}({number})", "(lambda t: t / 2 + {constant:0:2})({number})",
        "[{number}, {constant}][{whole:0:1}]", "{constant} if {whole:0:9} > 4 else {number}",
        "sum([{constant:0:2}, {number}, 0.5])", "{constant} + {constant:0:2} * sin({angle})",
        "{constant} * cos({oriented}.heading)", "resample({hidden})", "hypot({constant:0:3}, {number})",
        "{{'near': {number}, 'far': {constant}}}['near']", "Range({low}, Range({middle}, {high}))",
        "Normal({hidden}, {deviation})", "({number}) % {whole:3:9}", "round({number})",
        "{located}.distanceTo(Vector{place}) / {constant:3:9}", "len({nearlane}.maneuvers) + {number}",
        "{car}.lane.centerline.length / {constant:20:60}",
    ),
    "angle": (
        "({angle} relative to {oriented}.heading)", "({angle}) + {constant:-20:20} deg",
        "(angle from {place} to {thing})", "(angle to {place})",
        "(relative heading of {oriented}) + {constant:-9:9} deg",
        "Uniform({constant:-90:90}, {constant:-30:30}, {number:-40:40}) deg",
        "(apparent heading of {oriented} from {place})", "(angle from {thing} to {thing})",
        "{located}.angleTo(Vector{place})", "({oriented}.heading - {oriented}.heading) / 2",
        "Normal({constant:-60:60}, {constant:2:30}) deg", "(relative heading of {oriented} from {oriented})",
        "-({angle})", "Discrete({{0: 1, 180: 1}}) deg",
    ),
    "bearing": (
        "(roadDirection at {car})", "(roadDirection at {place})", "{lane}.orientation[Vector{place}]",
        "({field} at {vector})", "({angle} relative to {bearing})", "({angle} relative to {oriented})",
        "{crossing0}.roads[0].orientation[Vector{place}]", "({bearing} relative to {oriented})",
        "{lane}.centerline.orientation[{oriented}.position]", "network.nominalDirectionsAt({place})[0]",
        "{lane}.nominalDirectionsAt({vector})[0]",
    ),
    "vector": (
        "({vector} offset by {pair})", "({thing} offset by {pair})", "({pair} relative to {thing})",
        "({vector} offset along {angle} by {pair})", "({oriented} offset along {angle} by {pair})",
        "(front of {object})", "(back right of {object}).position", "(left of {object}).position",
        "(front left of {object})", "({located} + Vector({number:-9:9}, {number:-9:9}))",
        "(follow {field} from {car} for {number:2:25})", "(follow {field} from {place} for {number:5:30})",
        "({located} + {thing}.position) / 2", "Uniform({thing}, {place})", "Uniform({vector}, {vector})",
        "{located}.rotatedBy({constant:-2:2} deg)", "{lane}.centerline.start", "{nearlane}.centerline.end.position",
        "{located}.offsetRotated({angle}, Vector({constant:-3:3}, {constant:2:9}))", "{lane}.centerline.points[0]",
        "{lane}.centerline.pointAlongBy({number:1:12})", "{nearlane}.centerline.pointAlongBy(0.5, normalized=True)",
        "(new Point in {region})", "(new OrientedPoint on {region})",
        "{lane}.flowFrom(Vector{place}, {constant:3:12})", "Vector(*{place})",
        "{located}.offsetRadially({number:2:9}, {angle})", "({thing} if {whole:0:9} > 5 else {place})",
    ),
    "pair": (
        "(Uniform(-1, 1) * {constant:2:5}, {number:-9:20})", "({hidden}, {number:3:12})", "(0, {number:4:25})",
        "({number:-5:5}, {number:-20:20})", "Vector({number:-3:3}, {number:5:15}).rotatedBy({constant:-90:90} deg)",
    ),
    "field": (
        "{section}.orientation", "{group}.orientation", "{street}.orientation", "{crossing}.orientation",
        "{lane}.successor.orientation", "{turn}.connectingLane.orientation", "{lane}.centerline.orientation",
    ),
    "lane": (
        "{turn}.startLane", "{turn}.endLane", "{turn}.connectingLane", "{group}.lanes[{end}]",
        "{street}.lanes[{end}]", "{section}.lane", "{crossing}.incomingLanes[{end}]",
        "Uniform(*{crossing0}.incomingLanes)", "Uniform(*{crossing}.outgoingLanes)", "{crossing}.outgoingLanes[0]",
        "{lane}.successor", "{lane}.predecessor", "{group0}.laneAt({place})", "Uniform(*{group}.lanes)",
        "Uniform(*{street}.lanes)", "{group}.opposite.lanes[0]",
        "Uniform(*filter(lambda l: len(l.maneuvers) > 1, network.lanes))", "{section}.laneToLeft.lane",
        "Uniform(*{car}.lane.adjacentLanes)", "Uniform({lane}, {lane})", "Uniform(*{car}.road.lanes)",
        "Uniform(*[l for l in network.lanes if l.group is not {nearlane}.group])",
        "{car}.laneSection.laneToRight.lane", "Uniform(*Uniform(*network.lanes).group.lanes)",
        "{car}.lane.maneuvers[0].endLane", "Uniform(*{car}.lane.maneuvers).connectingLane",
        "{street0}.laneAt({place})", "{car}.oppositeLaneGroup.lanes[{end}]",
        "(network.laneAt({place}) if network.laneAt({place}) else network.lanes[0])",
    ),
    "section": (
        "{lane}.sections[{end}]", "{section}.laneToLeft", "{section}.laneToRight", "{lane}.sectionAt({place})",
        "Uniform(*{lane}.sections)", "{section}.shiftedBy({whole:-1:1})", "{car}.laneSection.fasterLane",
        "{street}.sections[0].lanes[{end}]", "Uniform(*{street}.sections[{end}].lanes)", "{section}.slowerLane",
        "Uniform(*filter(lambda s: s._laneToLeft and s._laneToLeft.isForward, network.laneSections))",
        "Uniform(*[s for s in network.laneSections if s._laneToRight])", "{street0}.laneSectionAt({place})",
        "Uniform(*{section}.adjacentLanes)", "{street}.sections[{end}].forwardLanes[0]",
    ),
    "group": (
        "{lane}.group", "{street}.forwardLanes", "{street}.backwardLanes", "{group}.opposite", "{section}.group",
        "{street}.laneGroups[{end}]", "{car}.oppositeLaneGroup", "Uniform(*{street}.laneGroups)",
        "Uniform(*filter(lambda g: g._opposite, network.laneGroups))", "{car}.lane.group",
        "{street0}.laneGroupAt({place})",
    ),
    "street": (
        "{lane}.road", "{group}.road", "{section}.road", "{crossing}.roads[{end}]", "Uniform(*{crossing}.roads)",
        "Uniform(*filter(lambda r: r.is1Way, network.roads))",
        "Uniform(*[r for r in network.roads if not r.is1Way])", "Uniform(*network.allRoads)",
        "Uniform(*network.connectingRoads)", "{car}.lane.road",
    ),
    "crossing": (
        "{turn}.intersection", "Uniform(network.intersections[0], network.intersections[1])",
        "Uniform(*[i for i in network.intersections if len(i.incomingLanes) > 3])",
        "{car}.lane.maneuvers[0].intersection",
    ),
    "turn": (
        "Uniform(*{turn}.conflictingManeuvers)", "Uniform(*{turn}.reverseManeuvers)", "Uniform(*{lane}.maneuvers)",
        "Uniform(*{crossing}.maneuvers)", "Uniform(*{car}.lane.maneuvers)", "{crossing}.maneuvers[{end}]",
    ),
    "region": (
        "{area}", "{area}.intersect({area})", "{area}.difference({area})", "road.intersect({area})",
        "{lane}.intersect({area})", "{area}.union({area})", "road.difference(intersection)", "visible {region}",
        "visible road", "({region} visible from {oriented})", "(road not visible from {oriented})",
        "not visible {area}", "{group}.curb", "{lane}.leftEdge", "{lane}.rightEdge", "{group}.leftEdge",
        "{street}.rightEdge", "{group}.sidewalk", "{street}.sidewalkRegion", "Uniform(*{street}.sidewalks)",
        "{group}.shoulder", "shoulder", "sidewalk", "{section}.centerline", "{street}.centerline",
        "network.laneRegion", "network.intersectionRegion", "network.roadRegion", "network.drivableRegion",
        "network.curbRegion", "network.shoulderRegion", "Uniform(*network.sidewalks)", "Uniform(*network.shoulders)",
        "{lane}.difference(intersection)", "PolylineRegion([{place+0+0}, {place+9+3}, {place+18+12}])",
        "PointSetRegion('posts', [{place+0+0}, {place+5+5}])", "CircularRegion({vector}, {number:3:20})",
        "RectangularRegion({vector}, {angle}, {number:3:20}, {number:3:20})",
        "SectorRegion({vector}, {number:5:30}, {angle}, {constant:30:200} deg)", "everywhere.intersect({area})",
        "Uniform({lane}, {area})", "Uniform({lane}, {lane})", "Uniform({region}, {region})",
        "{region}.intersect({area})", "{street}.sections[{end}]", "{crossing}.difference({area})",
        "Uniform(*{section}.adjacentLanes)", "{car}.visibleRegion", "{lane}.centerline.difference({area})",
        "{region}.difference({area})",
    ),
    "condition": (
        "not ({condition})", "({condition}) or ({condition})", "({condition}) and ({condition})",
        "({condition}) implies ({condition})", "{car} in {region}", "{car} not in {area}",
        "{object} intersects {region}", "(distance from {car} to intersection) {compare} {constant:3:60}",
        "{car}._lane is not None", "not {object}._intersection",
        "network.laneAt({car}) is not network.laneAt({other})", "{car}._lane is {car}._lane",
        "{car}.lane is not {lane}", "len(network.laneAt({car}).maneuvers) > 0 if network.laneAt({car}) else False",
        "{car}.road.is1Way == {truth}", "len({car}.laneGroup.lanes) >= 1",
        "{car}.lane.centerline.length > {constant:2:20}", "{car}._road is not {other}._road",
        "all([(distance to t) < {constant:40:150} for t in [{other}, {object}]])",
        "any(({object} in l) for l in {car}.road.lanes)",
        "{constant:0:3} < (distance from {thing} to {place}) < {constant:40:200}",
        "(distance from {thing} to {lane}) < {constant:20:200}", "{car}._laneGroup is {other}._laneGroup or {truth}",
        "({object}.position.distanceTo({thing}.position) > {constant:1:5}) if {condition} else ({condition})",
        "abs({oriented}.heading - {oriented}.heading) < {constant:100:200} deg",
        "{car}.laneSection.isForward == {truth}", "{car}.lane in {car}.road.lanes",
        "{car}._lane in [{nearlane}, {other}._lane]",
        "len([t for t in [{thing}, {thing}] if t in road]) >= {whole:0:1}", "({number:1:9}) {compare} {number:1:9}",
        "({angle}) {compare} {constant:-90:90} deg", "({vector} in {region}) or {truth}",
        "{car}.intersection is {crossing0} or {truth}", "{car}._element is not None",
        "{car}.laneSection._laneToLeft is None or {truth}", "isinstance({object}, Car)",
        "{car}.isCar and {condition}", "bool({car}._lane) == {truth} or {condition}",
        "[c for c in [{condition}, {truth}]][0]", "({condition}) == {truth}", "{thing} can see {thing}",
        "max([distance to t for t in [{other}, {thing}]]) < {constant:50:150}",
        "{car}.oppositeLaneGroup is not None", "{turn}.startLane is not {car}._lane",
        "(lambda a, b: (distance from a to b) > 2)({thing}, {thing})",
        "{car}.visibleRegion.containsPoint({vector}) or {truth}", "{check}({thing}, {thing})",
    ),
}  # fmt: skip
"""Forms that nest others."""

SPECIFIERS: dict[str, tuple[str, ...]] = {
    "position": (
        "at {vector}", "at {vector}", "on {region}", "in {region}", "on {region}", "on {lane}",
        "contained in {area}", "{side} {oriented} by {number:2:12}", "{side} {oriented} by {number:2:12}",
        "{side} {oriented}", "{side} {vector} by {number:1:9}, facing {angle}", "{side} {oriented} by {pair}",
        "following {field} from {thing} for {number:3:30}", "following {field} from {place} for {number:-15:25}",
        "following roadDirection from {car} for {number:3:30}", "at {beside}", "on {lane}.centerline",
        "beyond {thing} by {number:2:12} from {place}", "beyond {located} by {pair} from {thing}",
        "at {oriented} offset by {pair}", "at {thing} offset along {angle} by {pair}",
    ),
    "place on foot": (
        "on sidewalk", "on network.walkableRegion", "on Uniform(*network.sidewalks)", "on {group}.sidewalk",
    ),
    "position from ego": (
        "offset by {pair}", "offset along {angle} by {pair}", "beyond {other} by {number:2:9}", "visible",
        "following roadDirection for {number:3:30}", "visible from {oriented}",
        "on road, not visible from {oriented}", "beyond {thing} by {pair}",
        "at (follow roadDirection from ego for {number:3:20})", "on road, not visible", "on visible {region}",
        "on (road visible from {oriented})",
    ),
    "heading": (
        "facing {angle}", "facing {angle}", "facing {bearing}", "facing {bearing}",
        "facing {angle} relative to {oriented}", "facing toward {vector}", "facing away from {thing}",
        "facing directly toward {place}", "facing directly away from {thing}",
        "facing {angle} relative to {oriented}.heading", "facing {field}",
    ),
    "heading on a road": (
        "facing roadDirection", "facing {angle} relative to roadDirection",
        "facing {number:-60:60} deg relative to roadDirection",
    ),
    "heading from ego": (
        "apparently facing {angle}", "apparently facing {angle} from {place}", "facing (angle to {other})",
    ),
    "place of ego": (
        "", "on road", "on {lane}", "at {place}, facing roadDirection", "at {place}", "on {region}",
        "following roadDirection from {place} for {number:2:20}", "at {beside}", "at {point}",
        "on {lane}.centerline", "in {crossing}", "ahead of {orientedpoint} by {number:2:9}", "at {vector}",
    ),
}  # fmt: skip
"""Forms of specifiers, by what they need: an ego, a road, feet."""
