#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the seeds of the fuzzers.

make_corpus.py            small seeds, into corpus/ beside this script
make_corpus.py --large F  files that once took hours or all memory, into folder F, for trying programs by hand
"""

import argparse
import hashlib
import json
import pathlib
import struct
import subprocess
import zlib

HERE = pathlib.Path(__file__).resolve().parent
EXAMPLES = HERE.parent.parent / "examples"

SQUARE = [(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)]


def png(columns, rows, bits=16, colour=0, rows_given=None):
    """Grey PNG of zeros; its header may claim more rows than there are."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    given = rows if rows_given is None else rows_given
    packer = zlib.compressobj(9)
    line = bytes(1 + columns * bits // 8)
    data = b"".join(packer.compress(line) for _ in range(given)) + packer.flush()
    header = struct.pack(">IIBBBBB", columns, rows, bits, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def tiff(columns, rows, pixels, compression=1, bits=16, extra=(), order="<"):
    """Grey TIFF of one strip, its directory in front of the pixels."""
    entries = [(256, 4, columns), (257, 4, rows), (258, 3, bits), (259, 3, compression), (262, 3, 1),
               (273, 4, 0), (277, 3, 1), (278, 4, rows), (279, 4, len(pixels)), *extra]
    start = 8 + 2 + 12 * len(entries) + 4
    directory = struct.pack(order + "H", len(entries))
    for tag, kind, value in sorted(entries):
        value = start if tag == 273 else value
        packed = struct.pack(order + "HH", value, 0) if kind == 3 else struct.pack(order + "I", value)
        directory += struct.pack(order + "HHI", tag, kind, 1) + packed
    magic = b"II*\0" if order == "<" else b"MM\0*"
    return magic + struct.pack(order + "I", 8) + directory + struct.pack(order + "I", 0) + pixels


def glb(document, binary=b""):
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def gltf(uri=None, indices=True):
    positions = b"".join(struct.pack("<3f", *(0.001 * v for v in p)) for p in SQUARE)
    triangles = struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    buffer = {"byteLength": len(positions + triangles)}
    if uri:
        buffer["uri"] = uri
    primitive = {"attributes": {"POSITION": 0}, "material": 0}
    if indices:
        primitive["indices"] = 1
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1], "rotation": [0, 0, 0, 1]},
                  {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}],
        "meshes": [{"primitives": [primitive]}], "materials": [{"name": "steel"}],
        "buffers": [buffer],
        "bufferViews": [{"buffer": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
                      {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6}]}
    return document, positions + triangles


def changed(document, **changes):
    """The document with other values at its top."""
    return {**document, **changes}


def gltf_of_extensions():
    """Documents that use extensions and sparse accessors, with the binary of gltf()."""
    document, _ = gltf()
    node, accessor = document["nodes"][0], document["accessors"][0]
    sparse = {"count": 2, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}}
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0, "SCALE": 0}}}
    hidden = {"KHR_node_visibility": {"visible": False}}
    short = {"bufferView": 0, "componentType": 5122, "normalized": True, "type": "VEC3", "count": 4}
    others = document["accessors"][1:]
    return {
        "sparse": changed(document, accessors=[{**accessor, "sparse": sparse}, *others]),
        "sparse_alone": changed(document, accessors=[{**accessor, "bufferView": -1, "count": 900_000, "sparse": sparse},
                                                     *others]),
        "instances": changed(document, nodes=[{**node, "extensions": instancing}, document["nodes"][1]]),
        "hidden": changed(document, nodes=[{**node, "extensions": hidden}, document["nodes"][1]]),
        "quantised": changed(document, accessors=[short, *others], extensionsRequired=["KHR_mesh_quantization"]),
        "unknown": changed(document, extensions={"ACME_bend": {}}),
    }


def stl_binary(count=2):
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *SQUARE[0], *SQUARE[i + 1], *SQUARE[i + 2], 0)
                      for i in range(2))
    return b"made as a seed".ljust(80) + struct.pack("<I", count) + facets


STL_TEXT = """solid seed
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 20 0 0
vertex 20 20 0
vertex 5 5 0
endloop
endfacet
endsolid seed
"""


def comb(teeth):
    corners = [(0, 0), (20, 0)]
    for i in range(teeth, 0, -1):
        corners += [(20 * i / teeth, 20), (20 * (i - 0.5) / teeth, 1)]
    return corners + [(0, 20)]


def obj(corners, faces=1):
    text = "".join(f"v {x:g} {y:g} 0\n" for x, y in corners)
    face = "f " + " ".join(str(i + 1) for i in range(len(corners))) + "\n"
    return "mtllib a.mtl\nusemtl steel\n" + text + face * faces


def ply(form):
    head = (f"ply\nformat {form} 1.0\ncomment unit: metre\nelement vertex 4\nproperty float x\nproperty float y\n"
            "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n")
    if form == "ascii":
        lines = ["%g %g %g 0 0 1" % p for p in SQUARE] + ["4 0 1 2 3"]
        return (head + "\n".join(lines) + "\n").encode()
    order = "<" if "little" in form else ">"
    body = b"".join(struct.pack(order + "6f", *p, 0, 0, 1) for p in SQUARE)
    return head.encode() + body + struct.pack(order + "B4i", 4, 0, 1, 2, 3)


def example(*names):
    return (EXAMPLES.joinpath(*names)).read_bytes()


def recordings():
    camera = {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6, "sensor_columns_px": 1280, "sensor_rows_px": 1024,
              "bit_depth_bit": 10, "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
              "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5,
              "dark_current_electrons_per_s": 0}
    image = {"file": "images/000.png", "kind": "laser", "timestamp_s": 50, "series": "aperture",
             "plate_position_id": 1, "same_speckle": False, "burst_frame_index": 0, "exposure_time_s": 0.004,
             "f_number": 8, "camera_distance_m": 0.331, "focus_distance_m": 0.331, "laser_distance_m": 0.416,
             "line_offset_m": 0, "roi_column_px": -16, "roi_row_px": -16, "roi_columns_px": 32, "roi_rows_px": 32,
             "repeat_group": 0}
    dark = dict(image, file="images/001.png", kind="dark", timestamp_s=60, plate_position_id=None)
    return camera, {
        "format": "laser-line-recordings", "format_version": 1, "set": "seed", "camera": camera,
        "lens": {"focal_length_m": 0.016, "transmission": 0.92},
        "laser": {"wavelength_m": 6.61e-7, "power_w": 0.00058, "divergence_rad": 0.00105,
                  "beam_focus_distance_m": 0.44, "fan_angle_deg": 36.8},
        "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.66, "ggx_alpha": 0.43},
        "rig": {"incidence_angle_deg": 45}, "recordings": [image, dark]}


QIF = """<?xml version="1.0" encoding="UTF-8"?>
<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">
<FileUnits><PrimaryUnits><LengthUnit><SIUnitName>meter</SIUnitName></LengthUnit></PrimaryUnits></FileUnits>
<Characteristics><CharacteristicDefinitions n="1"><FlatnessCharacteristicDefinition id="3">
<ToleranceValue>0.0001</ToleranceValue></FlatnessCharacteristicDefinition></CharacteristicDefinitions>
<CharacteristicNominals n="1"><FlatnessCharacteristicNominal id="4">
<CharacteristicDefinitionId>3</CharacteristicDefinitionId><FeatureNominalIds n="1"><Id>9</Id></FeatureNominalIds>
</FlatnessCharacteristicNominal></CharacteristicNominals></Characteristics></QIFDocument>
"""

PART21 = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('seed'),'2;1');
FILE_NAME('a','2026-01-01',(''),(''),'','','');
FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF'));
ENDSEC;
DATA;
#1=CARTESIAN_POINT('p',(0.,1.E-3,-2.5));
#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#3=MEASURE_WITH_UNIT(LENGTH_MEASURE(0.1),#2); /* a comment */
#4=DATUM('it''s','\\X2\\00E4\\X0\\',$,.F.);
ENDSEC;
END-ISO-10303-21;
"""

EMVA = """v 3.0
# seed
n 12 640 480
b 40000.0 120.0
i images\\b_001.png
i images\\b_002.png
d 40000,5
i d1.png
i d2.png
"""


MATERIALS = {
    "lambert": {"name": "a", "lambert": {"diffuse_albedo": 0.5}},
    "ggx": {"name": "a", "lambert_ggx": {"diffuse_albedo": 0.3, "specular_f0": 0.5, "ggx_alpha": 0.2},
            "reflectance_spectrum": [{"wavelength_m": 4e-7, "value": 0.4}, {"wavelength_m": 7e-7, "value": 0.5}]},
    "conductor": {"name": "a", "conductor": {"refractive_index": [{"wavelength_m": 5e-7, "n": 1.2, "k": 6.5}],
                                             "ggx_alpha_x": 0.1, "ggx_alpha_y": 0.3,
                                             "machining_direction": {"x": 1, "y": 0, "z": 0}}},
    "merl": {"name": "a", "merl": {"file": "steel.binary"}},
}

LASER = {"name": "a", "laser": {"fan_angle_deg": 30, "line_profile": "LINE_PROFILE_POWELL", "wavelength_m": 4.5e-7,
                                "power_w": 0.05, "divergence_rad": 0.00286, "beam_focus_distance_m": 0.3}}

MEASUREMENT = {"camera_distance_m": 0.4, "triangulation_angle_deg": 30, "camera_azimuth_deg": 10,
               "camera_polar_deg": 5, "part_alpha_deg": 0, "part_beta_deg": 0, "part_gamma_deg": 90,
               "offset_y_m": 0, "offset_z_m": 0.01}


def pareto():
    points = [{"number": i + 1, "scans": i + 1, "time_s": 4.5 * (i + 1), "settled": 0.5 + 0.1 * i,
               "settled_targets": 100, "measurements": [MEASUREMENT] * (i + 1), "locked_scans": i}
              for i in range(3)]
    return {"inspection_name": "a", "part_digest": "2:" + 64 * "a", "scene_digest": "cd", "goal": 0.9, "judged_targets": 200,
            "points": points, "dominated": [{"scans": 4, "settled": 0.5}], "chosen": 2}


def verification():
    channels = [{"channel": "mono", "e_i": 0.02, "e_u": u, "row_px": [1.5, 2.5]} for u in (0.1, 0.2)]
    return {"set": "a", "recordings": [{"recording": i, "f_number": n, "channels": channels}
                                       for i, n in enumerate((4, 5.6, 8))]}


URDF = """<?xml version="1.0"?>
<!-- two joints -->
<robot name="seed">
  <link name="base"><collision><origin xyz="0 0 0.1" rpy="0 0 1.5"/><geometry><box size="0.3 0.3 0.2"/></geometry>
  </collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="0"/></joint>
  <link name="arm"><collision><geometry><cylinder radius="0.05" length="0.4"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="tip"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" velocity="0.3" effort="0"/></joint>
  <link name="tip"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
</robot>
"""


def hostile_urdf():
    """Trees that are deep for TinyXML, though their tags seem to be closed."""
    deep = 3000
    return {
        "deep": "<a>" * deep + "</a>" * deep,
        "closed_first": "</a>" * deep + "<a>" * deep,
        "closed_in_comments": "<a><!--></a>-->" * deep,
        "declaration": "<?xml >" + "<a>" * deep,
        "attributes": "<robot " + " ".join('a%d="1"' % i for i in range(3000)) + "/>",
        "loop": URDF.replace('<child link="arm"/>', '<child link="base"/>'),
        "misspelt": URDF.replace("collision>", "colision>"),
    }


HTTP = {
    "get": "GET /v1/jobs/a?page_size=10 HTTP/1.1\r\nHost: a\r\n\r\n",
    "post": "POST /v1/jobs HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\nhelloGET / HTTP/1.0\r\n\r\n",
    "chunked": "PUT /a HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n5;x=y\r\nhello\r\n0\r\nT: 1\r\n\r\n",
    "two_lengths": "POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "unknown_coding": "POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: xchunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
    "absolute": "HEAD http://a:80/%2e%2e/b HTTP/1.1\r\nHost: b\r\nAuthorization: Bearer abc\r\n\r\n",
}

MULTIPART = """multipart/form-data; boundary="a b"
--a b\r
Content-Disposition: form-data; name="inspection"; filename="in.json"\r
\r
{}\r
--a b\r
Content-Disposition: form-data; name=part; filename*=UTF-8''na%C3%AFve.stl\r
Content-Type: model/stl\r
\r
solid\r
--a b--\r
"""


def journal():
    """Answers to the questions of the target: gains and coverage of two scans, a score."""
    def digest(data):
        return hashlib.sha256(data).digest()[:8]

    default = struct.pack("<9d", 0.4, 0.5, 0, 0, 0, 0, 0, 0, 0)

    def query(kind, values=b""):
        return digest(struct.pack("<BQ", kind, 2) + default * 2 + struct.pack("<Q", len(values) // 4) + values)

    def bits(size, words):
        return struct.pack("<QQ%dQ" % len(words), size, len(words), *words)

    gain = struct.pack("<iiidd", 0, 5, 9, 0.5, 5)
    coverage = (struct.pack("<i", 0) + bits(70, (2**63 + 1, 3)) + bits(0, ()) + struct.pack("<iiq", 3, 40, 1000)
                + bits(0, ()) + struct.pack("<QI", 1, 7) + struct.pack("<Qf", 1, 0.5))
    score = struct.pack("<qqq", 60, 65, 70) + struct.pack("<Bq", 1, 40) + struct.pack("<Bq", 0, 0) + struct.pack("<q", 50)
    answers = b"sightline answers 2\nseed\n"
    for asked, answer in ((query(1), struct.pack("<Q", 2) + gain * 2),
                          (query(4), struct.pack("<Q", 2) + coverage * 2),
                          (query(5, struct.pack("<f", 1)), score)):
        answer = struct.pack("<q", 2) + answer  # evaluations that it cost
        answers += asked + digest(answer) + struct.pack("<II", len(answer), 0) + answer
    return answers


def encoded(message, text, proto="coverage_service"):
    """Bytes of a message on the wire, from its text."""
    command = ["protoc", f"--encode=sightline.v1.{message}", f"sightline/v1/{proto}.proto"]
    return subprocess.run(command, input=text.encode(), cwd=HERE.parent.parent / "proto", check=True,
                          capture_output=True).stdout


SCENE = f"""part_digest: "{'a' * 64}"
camera {{ columns_px: 1024 rows_px: 1024 vertical_fov_deg: 30 }}
targets {{ spacing_m: 0.002 coverage_radius_m: 0.0014 max_normal_angle_deg: 70 }}
obstacles {{ part_digest: "{'b' * 64}" frame: FRAME_STAGE }}
field_directions: 2304
part_placement {{ centre_m {{ x: 0.1 }} rotation_rad {{ z: 0.5 }} }}
measurement {{ camera_distance_m {{ ranges {{ min: 0.3 max: 0.5 }} }} resting_orientations {{ part_alpha_deg: 90 name: "side" }} }}
"""


def small():
    """Seeds by target and name."""
    square, binary = gltf()
    pixels = bytes(range(256)) * 8
    camera, plate = recordings()
    escape = '{"\\u001b[31mname": 1}'
    zeros = ",".join(["0"] * 2000)
    return {
        "glb": {**{name: glb(document, binary) for name, document in gltf_of_extensions().items()},
                "left_over": glb(square, binary + bytes(64)), "square": glb(square, binary), "no_indices": glb(gltf(indices=False)[0], binary),
                "extras": glb(('{"asset":{"version":"2.0"},"extras":[%s]}' % zeros).encode()),
                "deep": glb(('{"asset":' + "[" * 70 + "]" * 70 + "}").encode())},
        "gltf": {"data_uri": json.dumps(gltf("data:application/octet-stream;base64,AAAAAA==")[0]),
                 "outside": json.dumps(gltf("../outside.bin")[0]),
                 "escaped": json.dumps(gltf("%2e%2e/outside.bin")[0])},
        "stl": {"binary": stl_binary(), "claims_more": stl_binary(4_000_000_000), "text": STL_TEXT,
                "marks": "\ufeff" + STL_TEXT.replace("endsolid", "end solid").replace("\n", "\r") + "\0\x1a"},
        "ply": {**{form: ply(form) for form in ("ascii", "binary_little_endian", "binary_big_endian")},
                "left_over": ply("binary_little_endian") + bytes(24)},
        "obj": {"comb": obj(comb(12), 2),
                "joined": "v 0 0 0\nv 9 0 \\\r\n0\rv 0 9 0 # C:\\\nvn 0 \\\n1\nf 1 2\\\n 3\nf 1 1 2\nv 1e9 0 0\nf 1 2 4\n", "negative": "v 0 0 0\nv 9 0 0\nv 0 9 0\nf -3 -2 \\\n -1\n",
                "nan": "v nan 0 0\nv 9 0 0\nv 0 9 0\nv 1e308 -1e308 0\nf 1 2 4 3\n"},
        "points": {form: ply(form) for form in ("ascii", "binary_little_endian")},
        "image": {"grey16.png": png(32, 32), "grey8.png": png(16, 8, bits=8), "short.png": png(32, 32, rows_given=9),
                  "claims_60000.png": png(60000, 30000, rows_given=1), "grey16.tif": tiff(32, 32, pixels),
                  "big_endian.tif": tiff(32, 32, pixels, order=">"), "cut.tif": tiff(32, 32, pixels)[:1000],
                  "deflate.tif": tiff(32, 32, zlib.compress(pixels), 8),
                  "deflate_cut.tif": tiff(32, 32, zlib.compress(pixels), 8)[:-20],
                  "claims_40000.tif": tiff(40000, 40000, bytes(60)),
                  "tiles.tif": tiff(32, 32, pixels, extra=((322, 4, 16), (323, 4, 16))),
                  "turned.tif": tiff(32, 32, pixels, extra=((274, 3, 6),)),
                  "left_over.tif": tiff(32, 32, pixels) + b"more", "sub.tif": tiff(32, 32, pixels, extra=((330, 4, 8),)),
                  "left_over.png": png(32, 32) + b"more"},
        "height_field": {"text": "0 1 2\n3 4 5\n", "decimal_commas": "0,5\t1,25\n2\t3,5\n",
                         "two_ways": "0,5 1,5\n2 3\n", "semicolons": "\ufeff0,5;1\r\n2;3\r\n", "uneven": "1 2\n3\n"},
        "measured_table": {"text": "theta_l_deg,theta_d_deg,phi_d_deg,brdf_per_sr\n30,30,0,1.5\n30,32,-4,1\n"},
        "refractive_index": {"text": "wavelength_nm,n,k\n400,1.2,6.5\n700,1.9,8\n"},
        "inspection_json": {"cylinder_head": example("cylinder_head", "inspection.json"),
                            "uncertainty": example("cylinder_head_uncertainty", "inspection.json"),
                            "escape": escape,
                            "keys": '{"effects":[{"effect":"optics.coma","parameters":{%s}}]}'
                                    % ",".join(f'"k{i}":{i}' for i in range(50))},
        "plan_json": {"scan": '{"inspection_name":"a","scans":[{"index":1,"measurement":{"camera_distance_m":0.4},'
                              '"trigger_positions_m":[0,1e-4,-2.5]}]}', "escape": escape},
        "recordings_json": {"plate": json.dumps(plate), "null": '{"recordings":[{"plate_position_id": null}]}'},
        "sensor_json": {"camera": json.dumps(camera)},
        "merl": {"few": struct.pack("<3i4d", 90, 90, 180, 1, 2, -1, 0.5), "large": struct.pack("<3i", 2**31 - 1, 2, 2)},
        "material_json": {name: json.dumps(material) for name, material in MATERIALS.items()},
        "catalogue_camera_json": {"camera": example("catalogue", "cameras", "flir_bfs_u3_32s4m.json")},
        "catalogue_lens_json": {"lens": example("catalogue", "lenses", "kowa_lm12jc5m2.json")},
        "catalogue_laser_json": {"laser": json.dumps(LASER)},
        "pareto_json": {"front": json.dumps(pareto())},
        "optics_json": {"point": '{"points":[{"f_number":5.6}],"warnings":["a"]}', "escape": escape},
        "verification_json": {"three": json.dumps(verification())},
        "journal": {"answers": journal(), "cut": journal()[:-9]},
        "urdf": {"two_joints": URDF, "ur10e": example("cylinder_head_robot", "ur10e_cell.urdf"), **hostile_urdf()},
        "page_request": {"scan": json.dumps({"measurement": MEASUREMENT, "scan": 3,
                                             "setting": {"f_number": 8, "exposure_time_s": 0.01,
                                                         "focus_distance_m": 0.4}}),
                         "deep": '{"action":' + "[" * 30000 + "]" * 30000 + "}"},
        "finished_images": {"one": '{"request":"%s"}\n{"image":0,"files":[["images/a.png","%s"]]}\n'
                                   % (hashlib.sha256(b"").hexdigest(), hashlib.sha256(b"a picture").hexdigest())},
        "raw_png": {"grey16": png(32, 32), "grey8": png(16, 8, bits=8), "claims_60000": png(60000, 30000, rows_given=1)},
        "http_requests": HTTP,
        "http_multipart": {"two_parts": MULTIPART},
        "http_target": {"query": "/v1/jobs/a%20b?page_size=10&label=a%3Db", "absolute": "http://[::1]:80/a"},
        "receiver_url": {"mqtt": "mqtts://broker.example:8883/plans", "user": "https://me:" + "word@a/b",
                         "ipv6": "http://[::1]:8080/"},
        "traceparent": {"valid": "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
                        "later": "cc-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01-more"},
        "clients_json": {"two": json.dumps({"clients": [
            {"name": "mes", "token_sha256": hashlib.sha256(b"t").hexdigest(), "operator": True, "max_queued_jobs": 5},
            {"name": "page", "certificate_names": ["page.example"], "kinds": ["plan", "render"]}]})},
        "scene_spec": {"all": encoded("SceneSpec", SCENE),
                       "nan": encoded("SceneSpec", SCENE.replace("spacing_m: 0.002", "spacing_m: nan")
                                      .replace("min: 0.3", "min: -inf"))},
        "command_messages": {"lines": '{"progress":0.5,"message":"a"}\nwords\n{"error":{"code":"NOT_FOUND","message":"b"}}\n',
                             "large_number": '{"progress":1e999}\n{"progress":-1e308}\n'},
        "emva1288": {"set": EMVA},
        "qif": {"flatness": QIF, "entities": '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "cccc">'
                                             '<!ENTITY d "&b;&b;&b;">]><a>&d;&d;</a>'},
        "part21": {"step": PART21},
    }


def large():
    """Files that once took hours or all memory, by name."""
    zeros = "0," * 10_000_000 + "0"
    keys = ",".join(f'"k{i}":{i}' for i in range(200_000))
    return {
        "comb.obj": lambda: obj(comb(2046), 20),
        "extras.glb": lambda: glb(('{"asset":{"version":"2.0"},"extras":[%s]}' % zeros).encode()),
        "array.json": lambda: '{"rig": [%s]}' % ("0," * 40_000_000 + "0"),
        "keys.json": lambda: '{"effects":[{"effect":"optics.coma","parameters":{%s}}]}' % keys,
        "60000x30000.png": lambda: png(60000, 30000),
        "40000x40000.tif": lambda: tiff(40000, 40000, bytes(60)),
    }


def write(path, contents):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(contents.encode() if isinstance(contents, str) else contents)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--large", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_args().large
    if folder:
        for name, make in large().items():
            write(folder / name, make())
        return
    for target, seeds in small().items():
        for name, contents in seeds.items():
            write(HERE / "corpus" / target / name, contents)


if __name__ == "__main__":
    main()
