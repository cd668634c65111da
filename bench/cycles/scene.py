# SPDX-License-Identifier: Apache-2.0
"""Renders the scene of our_transport.cpp with Cycles; run by Blender.

    blender -b --factory-startup --python-exit-code 1 --python scene.py -- FOLDER --samples 64 --image OUT.pfm

Prints one line "cycles: {...}" of JSON: times of the rendering, and of loading apart from it.
"""

import argparse
import array
import json
import math
import pathlib
import re
import resource
import sys
import time

import bpy
import mathutils


def cpu_s():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def placed(obj, origin, x, y, z):
    """The object with these axes; columns of its matrix."""
    obj.matrix_world = mathutils.Matrix([[*row, o] for row, o in zip(zip(x, y, z), origin)] + [(0, 0, 0, 1)])
    bpy.context.collection.objects.link(obj)


def length(v):
    return math.sqrt(sum(x * x for x in v))


def add_part(description, folder):
    bpy.ops.import_mesh.ply(filepath=str(folder / description["mesh"]))
    mesh = bpy.context.object.data
    if (len(mesh.vertices), len(mesh.polygons)) != (description["vertices"], description["triangles"]):
        sys.exit("the mesh did not come through whole")
    material = bpy.data.materials.new("grey")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")  # roughness 0: Lambert
    diffuse.inputs["Color"].default_value = (*[description["albedo"]] * 3, 1)
    out = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs["BSDF"], out.inputs["Surface"])
    mesh.materials.clear()
    mesh.materials.append(material)
    for polygon in mesh.polygons:
        polygon.use_smooth = False


def add_lamp(lamp, ambient):
    u, v = lamp["half_edge_u_m"], lamp["half_edge_v_m"]
    light = bpy.data.lights.new("lamp", "AREA")
    light.shape = "RECTANGLE"
    light.size, light.size_y = 2 * length(u), 2 * length(v)
    # Cycles' lamps let light through, ours do not: from the front a lamp of L - ambient before the
    # ambient light is a lamp of L. Nothing of the scene lies behind it.
    radiance = lamp["radiance_w_m2_sr"] - ambient
    # Cycles makes a power P over an area A a radiance of P / (4 A), not P / (pi A).
    light.energy = 4 * light.size * light.size_y * radiance
    x = [a / length(u) for a in u]
    y = [-a / length(v) for a in v]  # it emits towards -z
    z = mathutils.Vector(x).cross(mathutils.Vector(y))
    placed(bpy.data.objects.new("lamp", light), lamp["centre_m"], x, y, z)


def add_ambient(radiance):
    world = bpy.data.worlds.new("ambient")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = radiance
    bpy.context.scene.world = world


def add_camera(description):
    ours = description["camera"]
    columns, rows = description["columns_px"], description["rows_px"]
    pitch = ours["pixel_pitch_m"]
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = 1e3 * columns * pitch
    camera.lens = 1e3 * ours["image_distance_m"]
    camera.clip_start, camera.clip_end = 1e-3, 1e3
    # Shifts are fractions of the image's width, right and up.
    camera.shift_x = (ours["first_u_m"] / pitch + (columns - 1) / 2) / columns
    camera.shift_y = -(ours["first_v_m"] / pitch + (rows - 1) / 2) / columns
    obj = bpy.data.objects.new("camera", camera)
    placed(obj, ours["origin_m"], ours["right"], [-x for x in ours["down"]], [-x for x in ours["forward"]])
    bpy.context.scene.camera = obj


def set_rendering(description, args):
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = description["columns_px"], description["rows_px"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", args.threads
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "NONE"
    cycles.device = "CPU"
    cycles.samples = 1
    cycles.seed = args.seed
    cycles.use_adaptive_sampling = args.adaptive > 0
    if args.adaptive > 0:
        cycles.adaptive_threshold = args.adaptive
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.max_bounces = cycles.diffuse_bounces = description["max_bounces"]
    cycles.pixel_filter_type = "BOX"
    if not args.default_roulette:
        # As ours: no light sample is left out by chance, paths end by chance from the second bounce.
        # Here this saves 10 to 75 % of the time to an error, by region.
        cycles.light_sampling_threshold = 0
        cycles.min_light_bounces = 2
    if args.crop:
        x, y, width, height = args.crop
        columns, rows = description["columns_px"], description["rows_px"]
        render.use_border = render.use_crop_to_border = True
        # Blender cuts fractions off.
        render.border_min_x, render.border_max_x = (x + 0.5) / columns, (x + width + 0.5) / columns
        render.border_min_y = (rows - y - height + 0.5) / rows
        render.border_max_y = (rows - y + 0.5) / rows


def write_pfm(image, path):
    """Blender's images start with the bottom row too."""
    pixels = array.array("f", bytes(4 * len(image.pixels)))
    image.pixels.foreach_get(pixels)
    red, green = pixels[0::4], pixels[1::4]
    if red != green:
        sys.exit("the image is not grey")
    columns, rows = image.size
    path.write_bytes(f"Pf\n{columns} {rows}\n-1.0\n".encode("ascii") + green.tobytes())


def render():
    """Wall and CPU time of one rendering."""
    start, start_cpu = time.monotonic(), cpu_s()
    bpy.ops.render.render()
    return {"wall_s": time.monotonic() - start, "cpu_s": cpu_s() - start_cpu}


def reported_s(exr):
    """The render time that Cycles writes into its images."""
    found = re.search(rb"render_time\0string\0....(?:(\d+):)?(\d+):([\d.]+)", exr.read_bytes(), re.DOTALL)
    return int(found[1] or 0) * 3600 + int(found[2]) * 60 + float(found[3])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path, help="with scene.json")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--adaptive", type=float, default=0, help="noise threshold; 0: every pixel alike")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--image", type=pathlib.Path, required=True)
    parser.add_argument("--default-roulette", action="store_true", help="Cycles' own settings of it")
    parser.add_argument("--crop", type=int, nargs=4, metavar=("X", "Y", "WIDTH", "HEIGHT"), help="in pixels")
    args = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    description = json.loads((args.folder / "scene.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_part(description, args.folder)
    add_lamp(description["lamp"], description["ambient_radiance_w_m2_sr"])
    add_ambient(description["ambient_radiance_w_m2_sr"])
    add_camera(description)
    set_rendering(description, args)
    # The first rendering loads the scene and builds the tree, which stay for the second.
    load = render()
    bpy.context.scene.cycles.samples = args.samples
    bpy.context.scene.update_tag()
    result = render()
    result.update({"load_s": load["wall_s"], "load_cpu_s": load["cpu_s"]})
    exr = args.image.with_suffix(".exr")
    bpy.data.images["Render Result"].save_render(str(exr))
    result["reported_s"] = reported_s(exr)
    write_pfm(bpy.data.images.load(str(exr)), args.image)
    exr.unlink()
    print("cycles: " + json.dumps(result), flush=True)


main()
