// SPDX-License-Identifier: Apache-2.0
// The part of a QIF document that is about tolerances, as a tree of elements with line numbers.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct QifElement {
  std::string name;  // local name
  int64_t line = 0;
  std::map<std::string, std::string> attributes;  // without namespaces
  std::string text;                               // of its own, trimmed; long texts are cut
  std::vector<QifElement> children;

  // The child of that name, or null. Throws QifRepeated if there are several: a file that states a
  // thing twice does not say which it means.
  const QifElement* Child(const std::string& child) const;
  // Text of the child of that name, or empty. Throws like Child.
  const std::string& ChildText(const std::string& child) const;
};

// An element that may stand once in its parent stands there again. ReadQif makes it an error.
struct QifRepeated {
  std::string parent, name;
  int64_t first_line = 0, line = 0;
};

// Parses and checks a QIF 3.0 document: well-formed XML without a document type, root QIFDocument
// in namespace http://qifstandards.org/xsd/qif3, versionQIF 3.0.x. With `schema_folder` (that of
// the QIF 3.0 schema, which has QIFApplications/QIFDocument.xsd) the whole document is validated
// as well. Kept are the root's children whose names are in `kept`; the rest is read past.
//
// Nothing is fetched: external entities are refused, and schemas are read from `schema_folder`
// only. NOT_FOUND: no such file or schema. INVALID_ARGUMENT names file, line and element; also for
// files over 1 GiB, more than 4 million elements kept, or elements nested deeper than 100.
absl::StatusOr<QifElement> ReadQifXml(const std::string& file, const std::string& schema_folder,
                                      std::span<const char* const> kept);

// The persistent id of a characteristic nominal or item: the UUID of its CharacteristicDesignator,
// else its first AttributeQPId, in lower case. Empty: none.
std::string QifPersistentId(const QifElement& characteristic);

}  // namespace sightline
