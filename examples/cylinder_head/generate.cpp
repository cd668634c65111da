// SPDX-License-Identifier: Apache-2.0
// Models the example part, a four-cylinder sixteen-valve cylinder head, and writes it as
// cylinder_head.step (B-rep) and cylinder_head.glb (triangles). All dimensions are in HeadDesign.
//
// Frame: x along the crankshaft, y from the intake to the exhaust side, z up, origin at a corner of
// the combustion face, millimetres (metres in the GLB).

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepAlgoAPI_Common.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <BRepOffsetAPI_MakePipe.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <GC_MakeArcOfCircle.hxx>
#include <GProp_GProps.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Writer.hxx>
#include <Standard_Failure.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <gp_Ax1.hxx>
#include <gp_Ax2.hxx>
#include <gp_Circ.hxx>
#include <gp_Dir.hxx>
#include <gp_Pnt.hxx>
#include <gp_Vec.hxx>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tools/step_import/glb_writer.h"
#include "tools/step_import/shape_mesh.h"

namespace sightline {
namespace {

// One row of ports with its valves. `side` mirrors the intake row to the exhaust side.
struct PortRow {
  double side;               // -1: opens at y = 0, +1: opens at y = width
  double valve_offset_y_mm;  // seat centre from the middle plane
  double valve_offset_x_mm;  // seat centre from the cylinder axis
  double valve_tilt_deg;     // stem from the vertical
  double seat_z_mm;          // seat centre
  double seat_radius_mm;     // outer, at the chamber
  double throat_radius_mm;   // narrowest, above the seat
  double port_radius_mm;
  double port_bend_radius_mm;  // of the centre line
  double port_opening_z_mm;
  double port_slope;             // dz per mm towards the middle
  double port_splay_mm;          // openings of a pair move apart by twice this
  double spring_seat_height_mm;  // along the stem, from the valve seat
};

// Heights are z above the combustion face; offsets in y count from the middle plane.
struct HeadDesign {
  double length_mm = 450.0, width_mm = 280.0, height_mm = 100.0;
  double outer_corner_radius_mm = 8.0;
  int cylinders = 4;
  double cylinder_pitch_mm = 100.0;

  // Combustion chamber: a pent roof inside a round recess.
  double chamber_radius_mm = 42.0;
  double roof_height_mm = 14.5;
  double chamber_wall_height_mm = 13.0;

  PortRow intake = {
      .side = -1.0,
      .valve_offset_y_mm = 22.0,
      .valve_offset_x_mm = 18.5,
      .valve_tilt_deg = 18.0,
      .seat_z_mm = 7.5,
      .seat_radius_mm = 16.5,
      .throat_radius_mm = 13.2,
      .port_radius_mm = 14.5,
      .port_bend_radius_mm = 36.0,
      .port_opening_z_mm = 58.0,
      .port_slope = -0.10,
      .port_splay_mm = 2.0,
      .spring_seat_height_mm = 72.0,
  };
  PortRow exhaust = {
      .side = 1.0,
      .valve_offset_y_mm = 22.0,
      .valve_offset_x_mm = 17.5,
      .valve_tilt_deg = 17.0,
      .seat_z_mm = 7.5,
      .seat_radius_mm = 14.5,
      .throat_radius_mm = 12.0,
      .port_radius_mm = 13.5,
      .port_bend_radius_mm = 32.0,
      .port_opening_z_mm = 52.0,
      .port_slope = -0.04,
      .port_splay_mm = 3.0,
      .spring_seat_height_mm = 72.0,
  };
  double guide_radius_mm = 4.0;
  double spring_seat_radius_mm = 15.0;

  // Spark plug wells.
  double plug_well_radius_mm = 11.5, plug_well_bottom_z_mm = 42.0;
  double plug_thread_radius_mm = 6.0;

  // Troughs under the camshafts, one per cylinder and row, between the bearing bulkheads.
  double trough_inner_y_mm = 20.0, trough_outer_y_mm = 86.0;
  double trough_half_length_mm = 38.0, trough_floor_z_mm = 81.0, trough_corner_radius_mm = 7.0;
  double cam_offset_y_mm = 50.0, cam_bearing_radius_mm = 13.5;
  double cam_bearing_end_x_mm = 438.0;  // blind at the flywheel end

  // Head bolts stand between the cylinders.
  double bolt_offset_y_mm = 48.0, bolt_radius_mm = 6.0;
  double bolt_counterbore_radius_mm = 10.0, bolt_counterbore_z_mm = 70.0;
  double dowel_radius_mm = 8.0, dowel_depth_mm = 12.0;

  // Side walls: a ledge outside the cover rail, the wall set back above a bottom rail, one flange
  // pad per cylinder, ribs between the pads, pockets in the rail.
  double ledge_width_mm = 40.0, ledge_z_mm = 89.0;
  double wall_setback_mm = 22.0, pad_setback_mm = 14.0, rib_setback_mm = 11.0, rail_z_mm = 30.0;
  double pad_width_mm = 88.0, pad_half_height_mm = 25.0, pad_corner_radius_mm = 8.0;
  double wall_rib_thickness_mm = 5.0;
  int side_pockets = 12;
  double side_rib_thickness_mm = 7.0, side_pocket_depth_mm = 7.0;
  double side_pocket_z0_mm = 9.0, side_pocket_z1_mm = 22.0;

  // Pockets of the end walls.
  int end_pocket_columns = 5, end_pocket_rows = 1;
  double end_pocket_depth_mm = 6.0, end_rib_thickness_mm = 7.0;
  double end_pocket_margin_y_mm = 28.0, end_pocket_z0_mm = 14.0, end_pocket_z1_mm = 68.0;

  // Water jacket. The two lower chambers open at the combustion face, the middle ones are closed.
  double jacket_inner_y_mm = 62.0, jacket_outer_y_mm = 104.0;
  double jacket_z0_mm = 11.0, jacket_z1_mm = 28.0, jacket_end_margin_mm = 16.0;
  double jacket_corner_radius_mm = 6.0, jacket_pillar_radius_mm = 11.0;
  double water_slot_offset_y_mm = 67.0, water_slot_length_mm = 18.0, water_slot_width_mm = 7.0;
  double middle_jacket_half_y_mm = 10.5, middle_jacket_half_x_mm = 31.0;
  double middle_jacket_z0_mm = 31.0, middle_jacket_z1_mm = 66.0;
  double water_outlet_radius_mm = 13.0, water_outlet_z_mm = 44.0, water_outlet_depth_mm = 16.0;

  // Oil.
  double drain_offset_y_mm = 80.0, drain_length_mm = 16.0, drain_width_mm = 9.0;
  double gallery_offset_y_mm = 94.0, gallery_z_mm = 75.0, gallery_radius_mm = 4.0,
         gallery_margin_mm = 20.0;

  // Threaded holes, modelled as their core holes with a drill tip.
  double stud_radius_mm = 3.4, stud_depth_mm = 14.0, stud_offset_x_mm = 36.5,
         stud_offset_z_mm = 18.0;
  double cover_screw_radius_mm = 2.5, cover_screw_depth_mm = 10.0;
  double cap_screw_radius_mm = 3.4, cap_screw_depth_mm = 15.0, cap_screw_offset_mm = 20.0;
  double drill_tip_deg = 118.0;
  double hole_chamfer_mm = 1.0;

  // Triangles.
  double chord_tolerance_mm = 0.06, angular_tolerance_deg = 25.0;
};

double Radians(double deg) { return deg * std::numbers::pi / 180.0; }

// --- Building blocks. Each returns a solid. ---

TopoDS_Shape Box(double x0, double y0, double z0, double x1, double y1, double z1) {
  return BRepPrimAPI_MakeBox(gp_Pnt(x0, y0, z0), gp_Pnt(x1, y1, z1)).Solid();
}

TopoDS_Shape Extrude(const TopoDS_Wire& wire, const gp_Vec& by) {
  return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire, true).Face(), by).Shape();
}

// Rectangle with rounded corners, centred at `origin`, extruded by `depth` along the frame's main
// direction; `size_u`, `size_v` along its X and Y directions.
TopoDS_Shape RoundedBlock(const gp_Ax2& frame, double size_u, double size_v, double radius,
                          double depth) {
  const gp_Vec u(frame.XDirection()), v(frame.YDirection());
  const auto at = [&](double a, double b) { return frame.Location().Translated(u * a + v * b); };
  const double hu = 0.5 * size_u, hv = 0.5 * size_v;
  BRepBuilderAPI_MakeWire wire;
  const double sign[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  for (int k = 0; k < 4; ++k) {
    const double su = sign[k][0], sv = sign[k][1];
    const double nu = sign[(k + 1) % 4][0], nv = sign[(k + 1) % 4][1];
    const double cu = su * (hu - radius), cv = sv * (hv - radius);
    const bool upright = k % 2 == 0;  // the arc starts on a side parallel to v
    const gp_Pnt start = upright ? at(su * hu, cv) : at(cu, sv * hv);
    const gp_Pnt end = upright ? at(cu, sv * hv) : at(su * hu, cv);
    const double r = radius * std::numbers::sqrt2 / 2.0;
    const gp_Pnt middle = at(cu + su * r, cv + sv * r);
    wire.Add(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(start, middle, end).Value()).Edge());
    const gp_Pnt next = upright ? at(nu * (hu - radius), nv * hv) : at(nu * hu, nv * (hv - radius));
    if (end.Distance(next) > 1e-6) wire.Add(BRepBuilderAPI_MakeEdge(end, next).Edge());
  }
  return Extrude(wire.Wire(), gp_Vec(frame.Direction()) * depth);
}

// Vertical pocket with rounded corners between two heights.
TopoDS_Shape RoundedPocket(double x0, double y0, double z0, double x1, double y1, double z1,
                           double radius) {
  const gp_Ax2 frame(gp_Pnt(0.5 * (x0 + x1), 0.5 * (y0 + y1), z0), gp_Dir(0, 0, 1),
                     gp_Dir(1, 0, 0));
  return RoundedBlock(frame, x1 - x0, y1 - y0, radius, z1 - z0);
}

// Solid of revolution: outline points (distance along the axis, radius), in order of distance.
TopoDS_Shape Revolve(const gp_Pnt& origin, const gp_Dir& axis,
                     const std::vector<std::pair<double, double>>& outline) {
  const gp_Ax2 frame(origin, axis);
  const gp_Vec along(axis), out(frame.XDirection());
  BRepBuilderAPI_MakePolygon polygon;
  const auto add = [&](double t, double r) { polygon.Add(origin.Translated(along * t + out * r)); };
  add(outline.front().first, 0.0);
  for (const auto& [t, r] : outline) {
    if (r > 0.0) add(t, r);
  }
  add(outline.back().first, 0.0);
  polygon.Close();
  const TopoDS_Face face = BRepBuilderAPI_MakeFace(polygon.Wire(), true).Face();
  return BRepPrimAPI_MakeRevol(face, gp_Ax1(origin, axis)).Shape();
}

TopoDS_Shape Rod(const gp_Pnt& from, const gp_Pnt& to, double radius) {
  const gp_Vec v(from, to);
  return BRepPrimAPI_MakeCylinder(gp_Ax2(from, gp_Dir(v)), radius, v.Magnitude()).Solid();
}

// Drilled hole from `mouth` along `axis` with a chamfered mouth and a conical bottom.
TopoDS_Shape BlindHole(const HeadDesign& d, const gp_Pnt& mouth, const gp_Dir& axis, double radius,
                       double depth) {
  const double tip = radius / std::tan(Radians(0.5 * d.drill_tip_deg));
  return Revolve(mouth, axis,
                 {{-1.0, radius + d.hole_chamfer_mm + 1.0},
                  {d.hole_chamfer_mm, radius},
                  {depth, radius},
                  {depth + tip, 0.0}});
}

// Round tube along the corners `path`, each inner corner rounded with `bend_radius`.
TopoDS_Shape Tube(const std::vector<gp_Pnt>& path, double bend_radius, double radius) {
  BRepBuilderAPI_MakeWire spine;
  gp_Pnt from = path.front();
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    const gp_Dir in(gp_Vec(path[i - 1], path[i])), out(gp_Vec(path[i], path[i + 1]));
    const double half_turn = 0.5 * in.Angle(out);
    const double tangent = bend_radius * std::tan(half_turn);
    const gp_Pnt start = path[i].Translated(gp_Vec(in) * -tangent);
    const gp_Pnt end = path[i].Translated(gp_Vec(out) * tangent);
    const gp_Dir to_centre(gp_Vec(out) - gp_Vec(in));
    const double apex = bend_radius / std::cos(half_turn) - bend_radius;
    const gp_Pnt middle = path[i].Translated(gp_Vec(to_centre) * apex);
    spine.Add(BRepBuilderAPI_MakeEdge(from, start).Edge());
    spine.Add(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(start, middle, end).Value()).Edge());
    from = end;
  }
  spine.Add(BRepBuilderAPI_MakeEdge(from, path.back()).Edge());
  const gp_Dir begin(gp_Vec(path[0], path[1]));
  const gp_Circ circle(gp_Ax2(path[0], begin), radius);
  const TopoDS_Wire section =
      BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire();
  return BRepOffsetAPI_MakePipe(spine.Wire(), BRepBuilderAPI_MakeFace(section, true).Face())
      .Shape();
}

double Volume(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::VolumeProperties(shape, properties);
  return properties.Mass();
}

TopTools_ListOfShape List(const std::vector<TopoDS_Shape>& shapes) {
  TopTools_ListOfShape list;
  for (const TopoDS_Shape& shape : shapes) list.Append(shape);
  return list;
}

TopoDS_Shape Cut(const TopoDS_Shape& from, const std::vector<TopoDS_Shape>& tools) {
  BRepAlgoAPI_Cut operation;
  operation.SetArguments(List({from}));
  operation.SetTools(List(tools));
  operation.Build();
  if (operation.HasErrors()) throw std::runtime_error("a boolean cut failed");
  return operation.Shape();
}

TopoDS_Shape Common(const TopoDS_Shape& a, const TopoDS_Shape& b) {
  BRepAlgoAPI_Common operation(a, b);
  if (operation.HasErrors()) throw std::runtime_error("a boolean intersection failed");
  return operation.Shape();
}

// --- The head ---

// The casting so far. Every cut is checked, because booleans can fail silently.
class Casting {
 public:
  explicit Casting(TopoDS_Shape shape) : shape_(std::move(shape)), volume_(Volume(shape_)) {}

  // Throws std::runtime_error if the result is not one valid solid with less material.
  void Remove(const char* what, const std::vector<TopoDS_Shape>& tools) {
    for (const TopoDS_Shape& tool : tools) {
      if (!BRepCheck_Analyzer(tool).IsValid() || Volume(tool) <= 0.0) {
        throw std::runtime_error(std::string(what) + ": a tool is not a valid solid");
      }
    }
    const TopoDS_Shape result = Cut(shape_, tools);
    const double volume = Volume(result);
    int solids = 0;
    for (TopExp_Explorer it(result, TopAbs_SOLID); it.More(); it.Next()) ++solids;
    std::printf("%-28s %4zu tools  %9.1f cm3\n", what, tools.size(), volume * 1e-3);
    std::fflush(stdout);
    if (solids != 1) throw std::runtime_error(std::string(what) + ": the casting fell apart");
    if (!BRepCheck_Analyzer(result).IsValid()) {
      throw std::runtime_error(std::string(what) + ": the result is not a valid solid");
    }
    if (!(volume > 0.0 && volume < volume_)) {
      throw std::runtime_error(std::string(what) + ": no material was removed");
    }
    shape_ = TopExp_Explorer(result, TopAbs_SOLID).Current();
    volume_ = volume;
  }

  const TopoDS_Shape& shape() const { return shape_; }

 private:
  TopoDS_Shape shape_;
  double volume_;
};

class HeadModeller {
 public:
  explicit HeadModeller(const HeadDesign& design) : d_(design), middle_y_(0.5 * design.width_mm) {}

  TopoDS_Shape Build() const {
    Casting casting(
        RoundedPocket(0, 0, 0, d_.length_mm, d_.width_mm, d_.height_mm, d_.outer_corner_radius_mm));
    casting.Remove("side walls", Sides());
    casting.Remove("side and end pockets", WallPockets());
    casting.Remove("cam troughs", Troughs());
    casting.Remove("cam bearings", CamBearings());
    casting.Remove("combustion chambers", Chambers());
    casting.Remove("ports", Ports());
    casting.Remove("valve seats, guides", Valves());
    casting.Remove("spark plug wells", PlugWells());
    casting.Remove("water jacket", Jackets());
    casting.Remove("water openings", WaterOpenings());
    casting.Remove("head bolts", HeadBolts());
    casting.Remove("oil drains, galleries", Oil());
    casting.Remove("threaded holes", ThreadedHoles());
    return casting.shape();
  }

 private:
  double CylinderX(int i) const {
    return 0.5 * d_.length_mm + (i - 0.5 * (d_.cylinders - 1)) * d_.cylinder_pitch_mm;
  }
  // Planes between and outside the cylinders, i = 0 .. cylinders.
  double BulkheadX(int i) const { return CylinderX(i) - 0.5 * d_.cylinder_pitch_mm; }
  double RowY(double side, double offset) const { return middle_y_ + side * offset; }

  // Towards the cylinder head cover, along the stem.
  gp_Dir Stem(const PortRow& row) const {
    const double tilt = Radians(row.valve_tilt_deg);
    return gp_Dir(0.0, row.side * std::sin(tilt), std::cos(tilt));
  }
  gp_Pnt Seat(const PortRow& row, int cylinder, double pair) const {
    return gp_Pnt(CylinderX(cylinder) + pair * row.valve_offset_x_mm,
                  RowY(row.side, row.valve_offset_y_mm), row.seat_z_mm);
  }
  double PortOpeningX(const PortRow& row, int cylinder, double pair) const {
    return CylinderX(cylinder) + pair * (row.valve_offset_x_mm + row.port_splay_mm);
  }

  template <typename Function>
  void ForEachValve(Function&& visit) const {
    for (const PortRow* row : {&d_.intake, &d_.exhaust}) {
      for (int i = 0; i < d_.cylinders; ++i) {
        for (const double pair : {-1.0, 1.0}) visit(*row, i, pair);
      }
    }
  }

  // Box between two distances from the middle plane.
  TopoDS_Shape SideBox(double side, double from, double to, double x0, double z0, double x1,
                       double z1) const {
    const double a = RowY(side, from), b = RowY(side, to);
    return Box(x0, std::min(a, b), z0, x1, std::max(a, b), z1);
  }

  std::vector<TopoDS_Shape> Sides() const {
    std::vector<TopoDS_Shape> tools;
    const double beyond = 10.0;
    for (const PortRow* row : {&d_.intake, &d_.exhaust}) {
      const double side = row->side, outside = middle_y_ + beyond;
      tools.push_back(SideBox(side, middle_y_ - d_.ledge_width_mm, outside, -beyond, d_.ledge_z_mm,
                              d_.length_mm + beyond, d_.height_mm + beyond));
      const double wall = middle_y_ - d_.wall_setback_mm;
      std::vector<TopoDS_Shape> kept;
      for (int i = 0; i < d_.cylinders; ++i) {
        // The pad grows out of the bottom rail.
        const double top = row->port_opening_z_mm + d_.pad_half_height_mm,
                     bottom = 0.5 * d_.rail_z_mm;
        const gp_Ax2 frame(
            gp_Pnt(CylinderX(i), RowY(side, middle_y_ - d_.pad_setback_mm), 0.5 * (top + bottom)),
            gp_Dir(0, -side, 0), gp_Dir(1, 0, 0));
        kept.push_back(RoundedBlock(frame, d_.pad_width_mm, top - bottom, d_.pad_corner_radius_mm,
                                    d_.wall_setback_mm));
      }
      for (int i = 0; i <= d_.cylinders; ++i) {
        const double x = BulkheadX(i), half = 0.5 * d_.wall_rib_thickness_mm;
        kept.push_back(SideBox(side, wall - beyond, middle_y_ - d_.rib_setback_mm, x - half,
                               0.5 * d_.rail_z_mm, x + half, d_.height_mm));
      }
      const TopoDS_Shape around = SideBox(side, wall, outside, -beyond, d_.rail_z_mm,
                                          d_.length_mm + beyond, d_.height_mm + 0.5 * beyond);
      for (TopExp_Explorer it(Cut(around, kept), TopAbs_SOLID); it.More(); it.Next()) {
        tools.push_back(it.Current());
      }
    }
    return tools;
  }

  std::vector<TopoDS_Shape> WallPockets() const {
    std::vector<TopoDS_Shape> tools;
    const double margin = 14.0;
    const double pitch = (d_.length_mm - 2 * margin + d_.side_rib_thickness_mm) / d_.side_pockets;
    const double size = pitch - d_.side_rib_thickness_mm;
    const double z = 0.5 * (d_.side_pocket_z0_mm + d_.side_pocket_z1_mm);
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i < d_.side_pockets; ++i) {
        const gp_Pnt at(margin + 0.5 * size + i * pitch, RowY(side, middle_y_ + 5.0), z);
        const gp_Ax2 frame(at, gp_Dir(0, -side, 0), gp_Dir(1, 0, 0));
        tools.push_back(RoundedBlock(frame, size, d_.side_pocket_z1_mm - d_.side_pocket_z0_mm, 3.0,
                                     d_.side_pocket_depth_mm + 5.0));
      }
    }
    const double pitch_y = (d_.width_mm - 2 * d_.end_pocket_margin_y_mm + d_.end_rib_thickness_mm) /
                           d_.end_pocket_columns;
    const double pitch_z =
        (d_.end_pocket_z1_mm - d_.end_pocket_z0_mm + d_.end_rib_thickness_mm) / d_.end_pocket_rows;
    for (const double end : {-1.0, 1.0}) {
      for (int i = 0; i < d_.end_pocket_columns; ++i) {
        for (int j = 0; j < d_.end_pocket_rows; ++j) {
          const gp_Pnt at(
              0.5 * d_.length_mm + end * (0.5 * d_.length_mm + 5.0),
              d_.end_pocket_margin_y_mm + 0.5 * (pitch_y - d_.end_rib_thickness_mm) + i * pitch_y,
              d_.end_pocket_z0_mm + 0.5 * (pitch_z - d_.end_rib_thickness_mm) + j * pitch_z);
          const gp_Ax2 frame(at, gp_Dir(-end, 0, 0), gp_Dir(0, 1, 0));
          tools.push_back(RoundedBlock(frame, pitch_y - d_.end_rib_thickness_mm,
                                       pitch_z - d_.end_rib_thickness_mm, 4.0,
                                       d_.end_pocket_depth_mm + 5.0));
        }
      }
    }
    return tools;
  }

  std::vector<TopoDS_Shape> Troughs() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      const double a = RowY(side, d_.trough_inner_y_mm), b = RowY(side, d_.trough_outer_y_mm);
      for (int i = 0; i < d_.cylinders; ++i) {
        const double x = CylinderX(i);
        tools.push_back(RoundedPocket(x - d_.trough_half_length_mm, std::min(a, b),
                                      d_.trough_floor_z_mm, x + d_.trough_half_length_mm,
                                      std::max(a, b), d_.height_mm + 10,
                                      d_.trough_corner_radius_mm));
      }
    }
    return tools;
  }

  std::vector<TopoDS_Shape> CamBearings() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      const double y = RowY(side, d_.cam_offset_y_mm);
      tools.push_back(Rod(gp_Pnt(-10, y, d_.height_mm),
                          gp_Pnt(d_.cam_bearing_end_x_mm, y, d_.height_mm),
                          d_.cam_bearing_radius_mm));
    }
    return tools;
  }

  std::vector<TopoDS_Shape> Chambers() const {
    std::vector<TopoDS_Shape> tools;
    for (int i = 0; i < d_.cylinders; ++i) {
      const double x = CylinderX(i);
      const double half = d_.chamber_radius_mm + 3.0;
      // Roof prism along x; it starts below the face so that no plane coincides with it.
      const double slope = d_.roof_height_mm / half;
      const double below = 5.0;
      BRepBuilderAPI_MakePolygon roof;
      roof.Add(gp_Pnt(x - 60, middle_y_ - half - below / slope, -below));
      roof.Add(gp_Pnt(x - 60, middle_y_ + half + below / slope, -below));
      roof.Add(gp_Pnt(x - 60, middle_y_, d_.roof_height_mm));
      roof.Close();
      const TopoDS_Shape prism = Extrude(roof.Wire(), gp_Vec(120, 0, 0));
      const TopoDS_Shape round =
          Rod(gp_Pnt(x, middle_y_, -2.0), gp_Pnt(x, middle_y_, d_.chamber_wall_height_mm),
              d_.chamber_radius_mm);
      tools.push_back(TopExp_Explorer(Common(prism, round), TopAbs_SOLID).Current());
    }
    return tools;
  }

  std::vector<TopoDS_Shape> Ports() const {
    std::vector<TopoDS_Shape> tools;
    ForEachValve([&](const PortRow& row, int cylinder, double pair) {
      const gp_Pnt seat = Seat(row, cylinder, pair);
      const gp_Dir stem = Stem(row);
      // Centre lines of stem and port meet at the corner that the bend rounds off.
      const double opening_distance = middle_y_;
      const double sin_t = std::abs(stem.Y()), cos_t = stem.Z();
      const double rise = row.port_opening_z_mm - row.seat_z_mm +
                          row.port_slope * (opening_distance - row.valve_offset_y_mm);
      const double t = rise / (cos_t + row.port_slope * sin_t);
      const gp_Pnt corner = seat.Translated(gp_Vec(stem) * t);
      const gp_Pnt opening(PortOpeningX(row, cylinder, pair), RowY(row.side, opening_distance),
                           row.port_opening_z_mm);
      // Starts outside the flange face, ends just above the throat.
      const gp_Vec out(gp_Dir(gp_Vec(corner, opening)));
      const gp_Pnt start = opening.Translated(out * 8.0);
      const gp_Pnt end = seat.Translated(gp_Vec(stem) * 6.0);
      tools.push_back(Tube({start, corner, end}, row.port_bend_radius_mm, row.port_radius_mm));
    });
    return tools;
  }

  std::vector<TopoDS_Shape> Valves() const {
    std::vector<TopoDS_Shape> tools;
    ForEachValve([&](const PortRow& row, int cylinder, double pair) {
      const gp_Pnt seat = Seat(row, cylinder, pair);
      const gp_Dir stem = Stem(row);
      const double seat_width = row.seat_radius_mm - row.throat_radius_mm;
      // Sunk rim, 45 degree seat, throat; the throat ends inside the wider port.
      tools.push_back(Revolve(seat, stem,
                              {{-9.0, row.seat_radius_mm + 0.8},
                               {0.6, row.seat_radius_mm + 0.8},
                               {0.6, row.seat_radius_mm},
                               {0.6 + seat_width, row.throat_radius_mm},
                               {9.0, row.throat_radius_mm}}));
      // Stem bore with the spring seat above it.
      tools.push_back(Revolve(seat, stem,
                              {{14.0, d_.guide_radius_mm},
                               {row.spring_seat_height_mm, d_.guide_radius_mm},
                               {row.spring_seat_height_mm, d_.spring_seat_radius_mm},
                               {row.spring_seat_height_mm + 14.0, d_.spring_seat_radius_mm}}));
    });
    return tools;
  }

  std::vector<TopoDS_Shape> PlugWells() const {
    std::vector<TopoDS_Shape> tools;
    for (int i = 0; i < d_.cylinders; ++i) {
      const gp_Pnt top(CylinderX(i), middle_y_, d_.height_mm);
      const double well = d_.height_mm - d_.plug_well_bottom_z_mm;
      tools.push_back(Revolve(top, gp_Dir(0, 0, -1),
                              {{-1.0, d_.plug_well_radius_mm + d_.hole_chamfer_mm + 1.0},
                               {d_.hole_chamfer_mm, d_.plug_well_radius_mm},
                               {well, d_.plug_well_radius_mm},
                               {well, d_.plug_thread_radius_mm + 3.0},
                               {well + 2.0, d_.plug_thread_radius_mm},
                               {d_.height_mm - 5.0, d_.plug_thread_radius_mm}}));
    }
    return tools;
  }

  std::vector<TopoDS_Shape> Jackets() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      const double a = RowY(side, d_.jacket_inner_y_mm), b = RowY(side, d_.jacket_outer_y_mm);
      const TopoDS_Shape chamber =
          RoundedPocket(d_.jacket_end_margin_mm, std::min(a, b), d_.jacket_z0_mm,
                        d_.length_mm - d_.jacket_end_margin_mm, std::max(a, b), d_.jacket_z1_mm,
                        d_.jacket_corner_radius_mm);
      std::vector<TopoDS_Shape> pillars;
      for (int i = 1; i < d_.cylinders; ++i) {
        const double y = RowY(side, d_.drain_offset_y_mm);
        pillars.push_back(Rod(gp_Pnt(BulkheadX(i), y, -10), gp_Pnt(BulkheadX(i), y, d_.height_mm),
                              d_.jacket_pillar_radius_mm));
      }
      tools.push_back(TopExp_Explorer(Cut(chamber, pillars), TopAbs_SOLID).Current());
    }
    for (int i = 1; i < d_.cylinders; ++i) {
      const double x = BulkheadX(i);
      tools.push_back(RoundedPocket(x - d_.middle_jacket_half_x_mm,
                                    middle_y_ - d_.middle_jacket_half_y_mm, d_.middle_jacket_z0_mm,
                                    x + d_.middle_jacket_half_x_mm,
                                    middle_y_ + d_.middle_jacket_half_y_mm, d_.middle_jacket_z1_mm,
                                    d_.jacket_corner_radius_mm));
    }
    return tools;
  }

  std::vector<TopoDS_Shape> WaterOpenings() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i < d_.cylinders; ++i) {
        const gp_Ax2 frame(gp_Pnt(CylinderX(i), RowY(side, d_.water_slot_offset_y_mm), -5.0),
                           gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
        tools.push_back(RoundedBlock(frame, d_.water_slot_length_mm, d_.water_slot_width_mm,
                                     0.5 * d_.water_slot_width_mm - 0.2,
                                     5.0 + 0.5 * (d_.jacket_z0_mm + d_.jacket_z1_mm)));
      }
    }
    tools.push_back(BlindHole(
        d_, gp_Pnt(d_.length_mm - d_.end_pocket_depth_mm, middle_y_, d_.water_outlet_z_mm),
        gp_Dir(-1, 0, 0), d_.water_outlet_radius_mm, d_.water_outlet_depth_mm));
    return tools;
  }

  std::vector<TopoDS_Shape> HeadBolts() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i <= d_.cylinders; ++i) {
        const gp_Pnt top(BulkheadX(i), RowY(side, d_.bolt_offset_y_mm), d_.height_mm);
        const double bore = d_.height_mm - d_.bolt_counterbore_z_mm;
        // Dowels centre the head at two opposite corners.
        const bool dowel = (side < 0 && i == 0) || (side > 0 && i == d_.cylinders);
        const double foot = dowel ? d_.dowel_radius_mm : d_.bolt_radius_mm + d_.hole_chamfer_mm;
        const double foot_height = dowel ? d_.dowel_depth_mm : d_.hole_chamfer_mm;
        std::vector<std::pair<double, double>> outline = {
            {-10.0, d_.bolt_counterbore_radius_mm},
            {bore, d_.bolt_counterbore_radius_mm},
            {bore, d_.bolt_radius_mm},
            {d_.height_mm - foot_height, d_.bolt_radius_mm}};
        if (dowel) outline.push_back({d_.height_mm - foot_height, foot});
        outline.push_back({d_.height_mm + (dowel ? 5.0 : 0.0), foot});
        outline.push_back({d_.height_mm + 6.0, foot + (dowel ? 0.0 : 6.0)});
        tools.push_back(Revolve(top, gp_Dir(0, 0, -1), outline));
      }
    }
    return tools;
  }

  std::vector<TopoDS_Shape> Oil() const {
    std::vector<TopoDS_Shape> tools;
    for (const double side : {-1.0, 1.0}) {
      for (int i = 1; i < d_.cylinders; i += 2) {
        const gp_Ax2 frame(gp_Pnt(BulkheadX(i), RowY(side, d_.drain_offset_y_mm), -5.0),
                           gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
        tools.push_back(RoundedBlock(frame, d_.drain_length_mm, d_.drain_width_mm,
                                     0.5 * d_.drain_width_mm - 1.0, d_.height_mm + 10.0));
      }
    }
    // Intake side: drilled from the front, blind. Exhaust side: closed at both ends.
    const double z = d_.gallery_z_mm;
    tools.push_back(BlindHole(d_, gp_Pnt(0, RowY(-1, d_.gallery_offset_y_mm), z), gp_Dir(1, 0, 0),
                              d_.gallery_radius_mm, d_.length_mm - d_.gallery_margin_mm));
    const double y = RowY(1, d_.gallery_offset_y_mm);
    tools.push_back(Rod(gp_Pnt(d_.gallery_margin_mm, y, z),
                        gp_Pnt(d_.length_mm - d_.gallery_margin_mm, y, z), d_.gallery_radius_mm));
    return tools;
  }

  std::vector<TopoDS_Shape> ThreadedHoles() const {
    std::vector<TopoDS_Shape> tools;
    for (const PortRow* row : {&d_.intake, &d_.exhaust}) {
      const gp_Dir inward(0, -row->side, 0);
      const double y = RowY(row->side, middle_y_ - d_.pad_setback_mm);
      for (int i = 0; i < d_.cylinders; ++i) {
        for (const double dz : {-d_.stud_offset_z_mm, d_.stud_offset_z_mm}) {
          for (const double dx : {-d_.stud_offset_x_mm, d_.stud_offset_x_mm}) {
            const gp_Pnt mouth(CylinderX(i) + dx, y, row->port_opening_z_mm + dz);
            tools.push_back(BlindHole(d_, mouth, inward, d_.stud_radius_mm, d_.stud_depth_mm));
          }
        }
      }
      const gp_Dir down(0, 0, -1);
      // Cover rail and cam bearing caps.
      const double rail = 0.5 * (d_.trough_outer_y_mm + middle_y_ - d_.ledge_width_mm);
      for (int i = 0; i <= d_.cylinders; ++i) {
        tools.push_back(BlindHole(d_, gp_Pnt(BulkheadX(i), RowY(row->side, rail), d_.height_mm),
                                  down, d_.cover_screw_radius_mm, d_.cover_screw_depth_mm));
        for (const double dy : {-d_.cap_screw_offset_mm, d_.cap_screw_offset_mm}) {
          const gp_Pnt mouth(BulkheadX(i), RowY(row->side, d_.cam_offset_y_mm + dy), d_.height_mm);
          tools.push_back(
              BlindHole(d_, mouth, down, d_.cap_screw_radius_mm, d_.cap_screw_depth_mm));
        }
      }
    }
    return tools;
  }

  HeadDesign d_;
  double middle_y_;
};

void WriteStep(const TopoDS_Shape& shape, const std::filesystem::path& file) {
  STEPControl_Writer writer;  // first: it declares the parameters below
  Interface_Static::SetCVal("write.step.schema", "AP214IS");
  Interface_Static::SetCVal("write.step.product.name", "cylinder head");
  Interface_Static::SetCVal("write.step.unit", "MM");
  Interface_Static::SetIVal("write.surfacecurve.mode", 0);  // no curves in parameter space
  if (writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone) {
    throw std::runtime_error("the solid cannot be translated to STEP");
  }
  // A fixed header: the same model gives the same bytes.
  APIHeaderSection_MakeHeader header(writer.Model());
  const auto text = [](const char* value) { return new TCollection_HAsciiString(value); };
  header.SetName(text("cylinder_head.step"));
  header.SetTimeStamp(text("2000-01-01T00:00:00"));
  header.SetAuthorValue(1, text("Sightline"));
  header.SetOrganizationValue(1, text("Sightline"));
  header.SetOriginatingSystem(text("sightline generate_cylinder_head"));
  header.SetDescriptionValue(1, text("Sightline example part"));
  if (writer.Write(file.string().c_str()) != IFSelect_RetDone) {
    throw std::runtime_error(file.string() + ": cannot be written");
  }
}

// Milled are the flat faces of the outside, as cast the rest of the skin, and sand cores leave what
// lies deeper.
void AssignMaterials(const HeadDesign& d, ShapeMesh* mesh) {
  enum : std::uint16_t { kMachined, kCastOuter, kSandCast };
  constexpr double kSkin_mm = 14, kFlat_mm = 1e-3;
  mesh->material_names = {"machined", "cast_outer", "sand_cast"};
  const std::array<double, 3> size_mm = {d.length_mm, d.width_mm, d.height_mm};
  for (const auto& triangle : mesh->triangles) {
    std::uint16_t material = kSandCast;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double wall_mm : {0.0, size_mm[axis]}) {
        double nearest_mm = 1e9, farthest_mm = 0;
        for (const std::uint32_t corner : triangle) {
          const double distance_mm = std::abs(mesh->positions_mm[corner][axis] - wall_mm);
          nearest_mm = std::min(nearest_mm, distance_mm);
          farthest_mm = std::max(farthest_mm, distance_mm);
        }
        if (farthest_mm < kFlat_mm) {
          material = kMachined;
        } else if (material == kSandCast && nearest_mm < kSkin_mm && axis != 2) {
          material = kCastOuter;
        }
      }
    }
    mesh->triangle_material.push_back(material);
  }
}

void Run(const std::filesystem::path& directory) {
  const HeadDesign design;
  const TopoDS_Shape head = HeadModeller(design).Build();
  ShapeMesh mesh = MeshShape(head, {design.chord_tolerance_mm, design.angular_tolerance_deg});
  mesh.name = "cylinder_head";
  AssignMaterials(design, &mesh);
  const MeshHealth health = CheckMesh(mesh);
  std::printf("%zu triangles, %zu vertices, %.4f m2, %.1f cm3 (B-rep %.1f)\n",
              mesh.triangles.size(), mesh.positions_mm.size(), health.area_mm2 * 1e-6,
              health.volume_mm3 * 1e-3, Volume(head) * 1e-3);
  std::printf(
      "boundary %zu, non-manifold %zu, misoriented %zu edges; %zu degenerate triangles; "
      "%zu repeated positions\n",
      health.boundary_edges, health.non_manifold_edges, health.misoriented_edges,
      health.degenerate_triangles, health.repeated_positions);
  if (!health.watertight() || health.degenerate_triangles > 0 || health.repeated_positions > 0) {
    throw std::runtime_error("the mesh is not a clean closed surface");
  }
  WriteStep(head, directory / "cylinder_head.step");
  WriteGlb({mesh}, {"sightline generate_cylinder_head", {}}, directory / "cylinder_head.glb");
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: generate_cylinder_head OUTPUT_DIRECTORY\n");
    return 2;
  }
  // OpenCASCADE reports on stdout otherwise.
  Message::DefaultMessenger()->ChangePrinters().Clear();
  try {
    sightline::Run(argv[1]);
    return 0;
  } catch (const Standard_Failure& failure) {
    std::fprintf(stderr, "generate_cylinder_head: %s: %s\n", failure.DynamicType()->Name(),
                 failure.GetMessageString());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "generate_cylinder_head: %s\n", error.what());
  }
  return 1;
}
