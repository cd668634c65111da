// SPDX-License-Identifier: Apache-2.0
// The entities of a STEP file as they are written (ISO 10303-21, clear text encoding), whatever
// their schema. Independent of OpenCASCADE, so that what that does not translate can be found.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace sightline {

// An attribute's value.
struct Part21Value {
  enum class Kind {
    kUnset,      // $
    kDerived,    // *
    kReference,  // #12: `reference`
    kNumber,     // integer or real: `number`
    kText,       // 'text' decoded to UTF-8, or "binary" as written: `text`
    kEnum,       // .WORD.: `text` without the dots
    kList,       // (a, b): `list`
    kTyped,      // LENGTH_MEASURE(0.2): `text` is the type, `list` its one value
  };
  Kind kind = Kind::kUnset;
  int64_t reference = 0;
  double number = 0;
  std::string text;
  std::vector<Part21Value> list;
};

// TYPE(values), all of a simple instance or one partial record of a complex one.
struct Part21Record {
  std::string type;  // upper case
  std::vector<Part21Value> values;
};

// A file held in memory; instances are parsed when they are asked for.
class Part21File {
 public:
  // Throws StepInputError naming the file if it cannot be read, is larger than 2 GiB, has no
  // instance, or one of more than 100 types or with a type of more than 200 characters.
  static Part21File Read(const std::filesystem::path& file);
  // The same from text; `name` is what messages call it.
  Part21File(std::string text, std::string name);
  // Its parts point into its text.
  Part21File(const Part21File&) = delete;
  Part21File& operator=(const Part21File&) = delete;

  // Instances one of whose types satisfies `wanted`, in the order of the file.
  template <typename Predicate>
  std::vector<int64_t> Find(const Predicate& wanted) const {
    std::vector<int64_t> found;
    for (const int64_t id : order_) {
      for (const std::string_view type : instances_.at(id).types) {
        if (!wanted(type)) continue;
        found.push_back(id);
        break;
      }
    }
    return found;
  }

  bool Has(int64_t id) const { return instances_.contains(id); }
  // Types of an instance, one if it is simple; none if there is no such instance.
  std::vector<std::string_view> Types(int64_t id) const;
  bool IsA(int64_t id, std::string_view type) const;
  // Its records. Throws StepInputError naming the instance if it is missing, malformed, or has more
  // than a million values.
  std::vector<Part21Record> Records(int64_t id) const;
  // First of FILE_SCHEMA in the header, e.g. "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF...".
  const std::string& schema() const { return schema_; }
  // Name of the file in messages.
  const std::string& name() const { return name_; }
  // Bytes of an instance's text; 0 if there is no such instance.
  size_t Bytes(int64_t id) const;

 private:
  struct Instance {
    size_t begin = 0, end = 0;  // of its right-hand side in text_
    std::vector<std::string_view> types;
  };

  std::string text_, name_, schema_;
  std::map<int64_t, Instance> instances_;
  std::vector<int64_t> order_;
};

}  // namespace sightline
