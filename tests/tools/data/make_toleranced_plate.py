#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes toleranced_plate.stp: a plate with two holes and a slanted end, and its drawing as semantic PMI.

    make_toleranced_plate.py > toleranced_plate.stp

AP242 (ISO 10303-242), millimetres and degrees, entity by entity: no CAD kernel takes part, so that the reader is
tried on a file that its own kernel has not written.
"""
import math

LENGTH_MM, WIDTH_MM, HEIGHT_MM = 60, 40, 12
SLANT_DEG = 60  # of the end at +x, to the bottom
HOLES_MM = [(15, 20), (45, 20)]
HOLE_RADIUS_MM = 4

HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('toleranced plate'),'2;1');
FILE_NAME('toleranced_plate.stp','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }'));
ENDSEC;
DATA;"""


class File:
    def __init__(self):
        self.lines = []

    def add(self, entity):
        self.lines.append(f"#{len(self.lines) + 1}={entity};")
        return f"#{len(self.lines)}"

    def point(self, p):
        return self.add(f"CARTESIAN_POINT('',({real(p[0])},{real(p[1])},{real(p[2])}))")

    def direction(self, d):
        return self.add(f"DIRECTION('',({real(d[0])},{real(d[1])},{real(d[2])}))")

    def vector(self, d):
        return self.add(f"VECTOR('',{self.direction(d)},1.)")

    def placement(self, p, axis, reference):
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.point(p)},{self.direction(axis)},{self.direction(reference)})")


def real(value):
    text = repr(round(float(value), 12) + 0.0).upper()  # no "-0."
    return text[:-1] if text.endswith(".0") else text


def references(ids):
    return "(" + ",".join(ids) + ")"


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return [x / length for x in a]


class Solid:
    """Faces of the plate; each edge is used by two of them, in opposite directions."""

    def __init__(self, file):
        self.file = file
        self.edges = {}
        far = LENGTH_MM + HEIGHT_MM / math.tan(math.radians(SLANT_DEG))
        self.corners = [(0, 0, 0), (far, 0, 0), (far, WIDTH_MM, 0), (0, WIDTH_MM, 0),
                        (0, 0, HEIGHT_MM), (LENGTH_MM, 0, HEIGHT_MM), (LENGTH_MM, WIDTH_MM, HEIGHT_MM),
                        (0, WIDTH_MM, HEIGHT_MM)]
        self.vertices = [file.add(f"VERTEX_POINT('',{file.point(p)})") for p in self.corners]
        self.circles = [[self.circle(x, y, z) for z in (0, HEIGHT_MM)] for x, y in HOLES_MM]
        # Corners counterclockwise, seen from outside. Holes run the other way round.
        self.bottom = self.plane([0, 3, 2, 1], [(lower, True) for lower, _ in self.circles])
        self.top = self.plane([4, 5, 6, 7], [(upper, False) for _, upper in self.circles])
        self.front = self.plane([0, 1, 5, 4])
        self.back = self.plane([2, 3, 7, 6])
        self.left = self.plane([0, 4, 7, 3])
        self.slant = self.plane([1, 2, 6, 5])
        self.holes = [self.cylinder(x, y, lower, upper)
                      for (x, y), (lower, upper) in zip(HOLES_MM, self.circles)]

    def line(self, a, b):
        """Oriented edge from corner to corner."""
        file = self.file
        if (b, a) in self.edges:
            return file.add(f"ORIENTED_EDGE('',*,*,{self.edges[(b, a)]},.F.)")
        start, end = self.corners[a], self.corners[b]
        along = unit(minus(end, start))
        curve = file.add(f"LINE('',{file.point(start)},{file.vector(along)})")
        edge = file.add(f"EDGE_CURVE('',{self.vertices[a]},{self.vertices[b]},{curve},.T.)")
        self.edges[(a, b)] = edge
        return file.add(f"ORIENTED_EDGE('',*,*,{edge},.T.)")

    def circle(self, x, y, z):
        """Edge and vertex of a whole circle, counterclockwise about +z."""
        file = self.file
        vertex = file.add(f"VERTEX_POINT('',{file.point((x + HOLE_RADIUS_MM, y, z))})")
        curve = file.add(f"CIRCLE('',{file.placement((x, y, z), (0, 0, 1), (1, 0, 0))},{real(HOLE_RADIUS_MM)})")
        return file.add(f"EDGE_CURVE('',{vertex},{vertex},{curve},.T.)"), vertex

    def loop(self, edges):
        return self.file.add(f"EDGE_LOOP('',{references(edges)})")

    def plane(self, corners, holes=()):
        file = self.file
        a, b, c = (self.corners[i] for i in corners[:3])
        normal = unit(cross(minus(b, a), minus(c, b)))
        surface = file.add(f"PLANE('',{file.placement(a, normal, unit(minus(b, a)))})")
        outer = self.loop([self.line(i, j) for i, j in zip(corners, [*corners[1:], corners[0]])])
        bounds = [file.add(f"FACE_OUTER_BOUND('',{outer},.T.)")]
        for (edge, _), forward in holes:
            turned = file.add(f"ORIENTED_EDGE('',*,*,{edge},.{'T' if forward else 'F'}.)")
            bounds.append(file.add(f"FACE_BOUND('',{self.loop([turned])},.T.)"))
        return file.add(f"ADVANCED_FACE('',{references(bounds)},{surface},.T.)")

    def cylinder(self, x, y, lower, upper):
        """A whole hole with a seam; its normal, out of the metal, is towards the axis."""
        file = self.file
        surface = file.add(f"CYLINDRICAL_SURFACE('',{file.placement((x, y, 0), (0, 0, 1), (1, 0, 0))},"
                           f"{real(HOLE_RADIUS_MM)})")
        foot = file.point((x + HOLE_RADIUS_MM, y, 0))
        seam = file.add(f"LINE('',{foot},{file.vector((0, 0, 1))})")
        edge = file.add(f"EDGE_CURVE('',{lower[1]},{upper[1]},{seam},.T.)")
        edges = [file.add(f"ORIENTED_EDGE('',*,*,{one},.{way}.)")
                 for one, way in ((edge, "T"), (upper[0], "T"), (edge, "F"), (lower[0], "F"))]
        bound = file.add(f"FACE_OUTER_BOUND('',{self.loop(edges)},.T.)")
        return file.add(f"ADVANCED_FACE('',({bound}),{surface},.F.)")

    def faces(self):
        return [self.bottom, self.top, self.front, self.back, self.left, self.slant, *self.holes]


class Drawing:
    def __init__(self, file, shape, representation, context, millimetre, degree):
        self.file, self.shape, self.representation, self.context = file, shape, representation, context
        self.millimetre, self.degree = millimetre, degree

    def aspect(self, faces, kind="SHAPE_ASPECT", name="", more=""):
        aspect = self.file.add(f"{kind}('{name}','',{self.shape},.T.{more})")
        for face in faces:
            self.file.add(f"GEOMETRIC_ITEM_SPECIFIC_USAGE('','',{aspect},{self.representation},{face})")
        return aspect

    def datum(self, letter, face):
        """The feature and the datum that it establishes."""
        feature = self.aspect([face], "DATUM_FEATURE", letter)
        datum = self.file.add(f"DATUM('','',{self.shape},.F.,'{letter}')")
        self.file.add(f"SHAPE_ASPECT_RELATIONSHIP('','',{feature},{datum})")
        return feature, datum

    def system(self, *datums):
        compartments = [self.file.add(f"DATUM_REFERENCE_COMPARTMENT('',$,{self.shape},.F.,{datum},$)")
                        for datum in datums]
        return self.file.add(f"DATUM_SYSTEM('',$,{self.shape},.F.,{references(compartments)})")

    def length(self, value):
        return self.file.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({real(value)}),{self.millimetre})")

    def angle(self, value):
        return self.file.add(f"PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE({real(value)}),{self.degree})")

    def complex(self, records):
        """An instance of several types, which stand in alphabetical order."""
        return self.file.add("(" + "".join(f"{kind}({records[kind]})" for kind in sorted(records)) + ")")

    def nominal(self, value, angle=False):
        kind, unit_of = ("PLANE_ANGLE", self.degree) if angle else ("LENGTH", self.millimetre)
        return self.complex({f"{kind}_MEASURE_WITH_UNIT": "", "MEASURE_REPRESENTATION_ITEM": "",
                             "MEASURE_WITH_UNIT": f"{kind}_MEASURE({real(value)}),{unit_of}",
                             "REPRESENTATION_ITEM": "'nominal value'"})

    def tolerance(self, kind, name, width, aspect, system=None, zone=None, modifier=None):
        magnitude = self.length(width)
        if system is None:
            return self.file.add(f"{kind}_TOLERANCE('{name}','',{magnitude},{aspect})")
        parts = {"GEOMETRIC_TOLERANCE": f"'{name}','',{magnitude},{aspect}",
                 "GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE": f"({system})", f"{kind}_TOLERANCE": ""}
        if modifier:
            parts["GEOMETRIC_TOLERANCE_WITH_MODIFIERS"] = f"(.{modifier}.)"
        tolerance = self.complex(parts)
        if zone:
            form = self.file.add(f"TOLERANCE_ZONE_FORM('{zone}')")
            self.file.add(f"TOLERANCE_ZONE('','',{self.shape},.F.,({tolerance}),{form})")
        return tolerance

    def value(self, dimension, items):
        values = self.file.add(f"SHAPE_DIMENSION_REPRESENTATION('',{references(items)},{self.context})")
        self.file.add(f"DIMENSIONAL_CHARACTERISTIC_REPRESENTATION({dimension},{values})")

    def limits(self, dimension, lower, upper):
        deviations = self.file.add(f"TOLERANCE_VALUE({lower},{upper})")
        self.file.add(f"PLUS_MINUS_TOLERANCE({deviations},{dimension})")


def main():
    file = File()
    application = file.add("APPLICATION_CONTEXT('managed model based 3d engineering')")
    file.add("APPLICATION_PROTOCOL_DEFINITION('international standard',"
             f"'ap242_managed_model_based_3d_engineering',2011,{application})")
    product_context = file.add(f"PRODUCT_CONTEXT('',{application},'mechanical')")
    product = file.add(f"PRODUCT('toleranced plate','toleranced plate','',({product_context}))")
    file.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))")
    formation = file.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    definition_context = file.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
    definition = file.add(f"PRODUCT_DEFINITION('design','',{formation},{definition_context})")
    shape = file.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")

    millimetre = file.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    radian = file.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    steradian = file.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    exponents = file.add("DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)")
    factor = file.add(f"PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE({math.pi / 180!r}),{radian})")
    degree = file.add(f"(CONVERSION_BASED_UNIT('DEGREE',{factor})NAMED_UNIT({exponents})PLANE_ANGLE_UNIT())")
    uncertainty = file.add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-6),{millimetre},"
                           "'distance_accuracy_value','')")
    context = file.add(f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({uncertainty}))"
                       f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({millimetre},{degree},{steradian}))"
                       "REPRESENTATION_CONTEXT('',''))")

    solid = Solid(file)
    shell = file.add(f"CLOSED_SHELL('',{references(solid.faces())})")
    body = file.add(f"MANIFOLD_SOLID_BREP('plate',{shell})")
    origin = file.placement((0, 0, 0), (0, 0, 1), (1, 0, 0))
    representation = file.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({origin},{body}),{context})")
    file.add(f"SHAPE_DEFINITION_REPRESENTATION({shape},{representation})")

    drawing = Drawing(file, shape, representation, context, millimetre, degree)
    bottom, a = drawing.datum("A", solid.bottom)
    front, b = drawing.datum("B", solid.front)
    left, c = drawing.datum("C", solid.left)
    of_a, of_abc = drawing.system(a), drawing.system(a, b, c)
    top = drawing.aspect([solid.top])
    slant = drawing.aspect([solid.slant])
    # The holes are a pattern: an aspect of two.
    holes = [drawing.aspect([hole]) for hole in solid.holes]
    pattern = drawing.aspect([], "COMPOSITE_GROUP_SHAPE_ASPECT")
    for hole in holes:
        file.add(f"SHAPE_ASPECT_RELATIONSHIP('','',{pattern},{hole})")

    drawing.tolerance("FLATNESS", "Flatness of A", 0.05, bottom)
    drawing.tolerance("PARALLELISM", "Parallelism of the top", 0.08, top, of_a)
    drawing.tolerance("PERPENDICULARITY", "Squareness of B", 0.1, front, of_a)
    drawing.tolerance("SURFACE_PROFILE", "Profile of the end", 0.5, slant, of_abc)
    drawing.tolerance("POSITION", "Position of the holes", 0.2, pattern, of_abc, "cylindrical or circular",
                      "MAXIMUM_MATERIAL_REQUIREMENT")

    diameter = file.add(f"DIMENSIONAL_SIZE({pattern},'diameter')")
    drawing.value(diameter, [drawing.nominal(2 * HOLE_RADIUS_MM)])
    drawing.limits(diameter, drawing.length(0), drawing.length(0.022))
    thickness = file.add(f"DIMENSIONAL_LOCATION('thickness',$,{bottom},{top})")
    drawing.value(thickness, [drawing.nominal(HEIGHT_MM)])
    drawing.limits(thickness, drawing.length(-0.1), drawing.length(0.1))
    angle = file.add(f"ANGULAR_LOCATION('slant',$,{bottom},{slant},.SMALL.)")
    drawing.value(angle, [drawing.nominal(SLANT_DEG, angle=True)])
    drawing.limits(angle, drawing.angle(-1), drawing.angle(1))
    # Theoretical positions of the holes: without limits of its own.
    pitch = file.add(f"DIMENSIONAL_LOCATION('pitch',$,{holes[0]},{holes[1]})")
    theoretical = file.add("DESCRIPTIVE_REPRESENTATION_ITEM('dimensional note','theoretical')")
    drawing.value(pitch, [drawing.nominal(HOLES_MM[1][0] - HOLES_MM[0][0]), theoretical])
    # A class of fits, whose table no reader of the file has.
    width = file.add(f"DIMENSIONAL_LOCATION('width',$,{front},{drawing.aspect([solid.back])})")
    drawing.value(width, [drawing.nominal(WIDTH_MM)])
    fit = file.add("LIMITS_AND_FITS('h','shaft','9','ISO 286')")
    file.add(f"PLUS_MINUS_TOLERANCE({fit},{width})")
    # C carries no tolerance.
    assert left

    print(HEADER)
    print("\n".join(file.lines))
    print("ENDSEC;\nEND-ISO-10303-21;")


if __name__ == "__main__":
    main()
