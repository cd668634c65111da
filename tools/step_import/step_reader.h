#pragma once

#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace sightline {

// The file itself is wrong; the message names it and says why.
class StepInputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct StepBody {
  std::string name;    // of the STEP product; "body" if it has none
  TopoDS_Shape shape;  // placed in the assembly, coordinates in millimetres
};

struct StepModel {
  std::vector<StepBody> bodies;  // never empty, each with at least one face
  std::string length_unit;       // as the file names it, e.g. "millimetre" or "INCH"
};

// Reads a STEP file (ISO 10303-21: AP203, AP214, AP242). One body per solid; faces outside any
// solid are gathered into one body per product. Whatever unit the file uses, shapes come back in
// millimetres.
// Throws StepInputError if the file is missing, is not STEP, is cut off, cannot be parsed, has
// damaged geometry or holds no faces. OpenCASCADE's own Standard_Failure may escape when it fails
// inside.
StepModel ReadStep(const std::filesystem::path& file);

}  // namespace sightline
