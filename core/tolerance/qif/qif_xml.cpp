// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_xml.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <xercesc/framework/LocalFileInputSource.hpp>
#include <xercesc/parsers/SAX2XMLReaderImpl.hpp>
#include <xercesc/sax/Locator.hpp>
#include <xercesc/sax/SAXParseException.hpp>
#include <xercesc/sax2/Attributes.hpp>
#include <xercesc/sax2/DefaultHandler.hpp>
#include <xercesc/util/OutOfMemoryException.hpp>
#include <xercesc/util/PlatformUtils.hpp>
#include <xercesc/util/SecurityManager.hpp>
#include <xercesc/util/TransService.hpp>
#include <xercesc/util/XMLEntityResolver.hpp>
#include <xercesc/util/XMLResourceIdentifier.hpp>
#include <xercesc/util/XMLUni.hpp>
#include <xercesc/validators/common/Grammar.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
namespace xc = xercesc;

constexpr const char* kNamespace = "http://qifstandards.org/xsd/qif3";
constexpr uintmax_t kMaxBytes = uintmax_t{1} << 30;
constexpr size_t kMaxElements = 4'000'000;
constexpr size_t kMaxDepth = 100;
// Names and numbers are short; polylines of features are not needed.
constexpr size_t kMaxTextBytes = 4096;
constexpr size_t kMaxOutlineBytes = 4 << 20;  // boundary of a plane

std::string Utf8(const XMLCh* text) {
  if (text == nullptr) return {};
  const xc::TranscodeToStr utf8(text, "UTF-8");
  return std::string(reinterpret_cast<const char*>(utf8.str()), utf8.length());
}

std::u16string Utf16(const std::string& text) {
  const xc::TranscodeFromStr utf16(reinterpret_cast<const XMLByte*>(text.data()), text.size(),
                                   "UTF-8");
  return std::u16string(utf16.str(), utf16.length());
}

std::string PathOf(const std::string& uri) {
  return std::string(absl::StripPrefix(uri, "file://"));
}

// Ends the parse from inside a handler.
struct Stop {
  absl::Status status;
};

class Handler final : public xc::DefaultHandler, public xc::XMLEntityResolver {
 public:
  Handler(std::string file, fs::path schema_folder, std::span<const char* const> kept)
      : file_(std::move(file)), schema_folder_(std::move(schema_folder)), kept_(kept) {}

  void set_loading_schema(bool loading) { loading_schema_ = loading; }
  QifElement Take() { return std::move(root_); }
  bool complete() const { return have_root_; }

  void setDocumentLocator(const xc::Locator* const locator) override { locator_ = locator; }

  void startElement(const XMLCh* const uri, const XMLCh* const local_name, const XMLCh* const,
                    const xc::Attributes& attributes) override {
    if (++depth_ > kMaxDepth) {
      Refuse(absl::StrCat("elements are nested more than ", kMaxDepth, " deep"));
    }
    const bool keep =
        depth_ == 1 ||
        (depth_ == 2 && std::find(kept_.begin(), kept_.end(), Utf8(local_name)) != kept_.end()) ||
        (depth_ > 2 && open_.size() + 1 == depth_ && IsOfUse(Utf8(local_name)));
    if (!keep) return;
    if (++elements_ > kMaxElements) {
      Refuse(absl::StrCat("more than ", kMaxElements, " elements about tolerances"));
    }
    QifElement element;
    element.name = Utf8(local_name);
    element.line = Line();
    for (XMLSize_t i = 0; i < attributes.getLength(); ++i) {
      element.attributes[Utf8(attributes.getLocalName(i))] = Utf8(attributes.getValue(i));
    }
    if (depth_ == 1) CheckRoot(Utf8(uri), element);
    open_.push_back(std::move(element));
  }

  // Only the surfaces of a product are kept, and which of them each face lies on.
  bool IsOfUse(const std::string& name) const {
    if (open_[1].name != "Product") return true;
    if (depth_ == 3) return name == "GeometrySet" || name == "TopologySet";
    return depth_ != 4 || name == "SurfaceSet" || name == "FaceSet";
  }

  void characters(const XMLCh* const text, const XMLSize_t length) override {
    if (open_.size() != depth_ || open_.empty()) return;
    std::string& own = open_.back().text;
    const size_t most = open_.back().name == "PolyLine" ? kMaxOutlineBytes : kMaxTextBytes;
    if (own.size() >= most) return;
    const std::u16string piece(text, std::min<XMLSize_t>(length, most));
    own += Utf8(piece.c_str());
    // Never inside a character.
    size_t end = std::min(own.size(), most);
    while (end > 0 && end < own.size() && (static_cast<unsigned char>(own[end]) & 0xc0) == 0x80) {
      --end;
    }
    own.resize(end);
  }

  void endElement(const XMLCh* const, const XMLCh* const, const XMLCh* const) override {
    if (open_.size() == depth_) {
      QifElement element = std::move(open_.back());
      open_.pop_back();
      absl::StripAsciiWhitespace(&element.text);
      if (open_.empty()) {
        root_ = std::move(element);
        have_root_ = true;
      } else {
        open_.back().children.push_back(std::move(element));
      }
    }
    --depth_;
  }

  // QIF has no document type; one could define entities that grow without bound.
  void startDTD(const XMLCh* const, const XMLCh* const, const XMLCh* const) override {
    Refuse("a document type (DOCTYPE) is not allowed in QIF");
  }

  xc::InputSource* resolveEntity(xc::XMLResourceIdentifier* resource) override {
    const std::string asked = Utf8(resource->getSystemId());
    if (!loading_schema_) Refuse("an external entity is not allowed: " + asked);
    if (asked.empty()) return nullptr;  // an import by namespace alone
    // Relative to the file that includes it.
    const fs::path from(PathOf(Utf8(resource->getBaseURI())));
    std::error_code error;
    const fs::path real = fs::weakly_canonical(from.parent_path() / PathOf(asked), error);
    const fs::path inside = real.lexically_relative(schema_folder_);
    if (error || inside.empty() || *inside.begin() == "..") {
      Refuse("the schema asks for " + asked + ", which is outside its folder");
    }
    return new xc::LocalFileInputSource(Utf16(real.string()).c_str());
  }

  void error(const xc::SAXParseException& exception) override { Report(exception); }
  void fatalError(const xc::SAXParseException& exception) override { Report(exception); }
  void warning(const xc::SAXParseException&) override {}
  void resetErrors() override {}

  // SAX's own resolver, which does not say relative to what; the one above is used.
  using xc::DefaultHandler::resolveEntity;

 private:
  int64_t Line() const {
    return locator_ == nullptr ? 0 : static_cast<int64_t>(locator_->getLineNumber());
  }

  [[noreturn]] void Refuse(const std::string& why) const {
    std::string where = absl::StrCat(file_, ":", Line(), ": ");
    if (!open_.empty()) absl::StrAppend(&where, "in <", open_.back().name, ">: ");
    throw Stop{absl::InvalidArgumentError(where + why)};
  }

  [[noreturn]] void Report(const xc::SAXParseException& exception) const {
    // A schema of its own file.
    const std::string source = loading_schema_ ? Utf8(exception.getSystemId()) : file_;
    std::string where = absl::StrCat(source, ":", exception.getLineNumber(), ": ");
    if (!open_.empty()) absl::StrAppend(&where, "in <", open_.back().name, ">: ");
    throw Stop{absl::InvalidArgumentError(where + Utf8(exception.getMessage()))};
  }

  void CheckRoot(const std::string& uri, const QifElement& root) const {
    if (root.name != "QIFDocument") {
      Refuse("the root element is <" + root.name + ">, not <QIFDocument>: not a QIF file");
    }
    if (uri != kNamespace) {
      Refuse(absl::StrCat("<QIFDocument> is in namespace \"", uri, "\"; QIF 3.0 has ", kNamespace));
    }
    const auto version = root.attributes.find("versionQIF");
    const std::string given = version == root.attributes.end() ? "" : version->second;
    if (given != "3.0" && !absl::StartsWith(given, "3.0.")) {
      Refuse("<QIFDocument>: versionQIF is \"" + given + "\"; only 3.0 can be read");
    }
  }

  std::string file_;
  fs::path schema_folder_;
  std::span<const char* const> kept_;
  bool loading_schema_ = false;
  const xc::Locator* locator_ = nullptr;
  size_t depth_ = 0, elements_ = 0;
  std::vector<QifElement> open_;  // kept elements that are not closed yet
  QifElement root_;
  bool have_root_ = false;
};

// Refuses the character NUL, which XML does not have: Xerces ends the document there without a
// word. In UTF-16, which begins with a byte order mark or has a 0 in its first character, NUL is
// two bytes.
absl::Status RefuseNul(const std::string& file) {
  constexpr size_t kChunkBytes = size_t{1} << 20;
  std::ifstream in(file, std::ios::binary);
  std::string chunk(kChunkBytes, '\0');
  size_t unit_bytes = 0, offset = 0;
  while (in.read(chunk.data(), kChunkBytes) || in.gcount() > 0) {
    const std::string_view bytes(chunk.data(), static_cast<size_t>(in.gcount()));
    if (unit_bytes == 0) {
      const bool utf16 =
          bytes.size() > 1 && (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF") ||
                               (bytes[0] == '\0') != (bytes[1] == '\0'));
      unit_bytes = utf16 ? 2 : 1;
    }
    for (size_t i = bytes.find('\0'); i != std::string_view::npos; i = bytes.find('\0', i + 1)) {
      if (unit_bytes == 2 && (i % 2 != 0 || i + 1 >= bytes.size() || bytes[i + 1] != '\0'))
        continue;
      return absl::InvalidArgumentError(absl::StrCat(
          file, ": byte ", offset + i, " is the character NUL, which XML does not have"));
    }
    offset += bytes.size();
  }
  return absl::OkStatus();
}

// Xerces keeps global tables; they live as long as the program.
void InitialiseXerces() {
  static const bool once = [] {
    xc::XMLPlatformUtils::Initialize();
    return true;
  }();
  static_cast<void>(once);
}

absl::StatusOr<fs::path> SchemaFile(const std::string& folder) {
  for (const char* candidate : {"QIFApplications/QIFDocument.xsd", "QIFDocument.xsd"}) {
    std::error_code error;
    const fs::path path = fs::path(folder) / candidate;
    if (fs::is_regular_file(path, error)) return fs::canonical(path);
  }
  return absl::NotFoundError(absl::StrCat(
      "QIF schema: ", folder,
      " has no QIFApplications/QIFDocument.xsd; give the folder of the QIF 3.0 schema"));
}

}  // namespace

const QifElement* QifElement::Child(const std::string& child) const {
  const QifElement* found = nullptr;
  for (const QifElement& element : children) {
    if (element.name != child) continue;
    if (found != nullptr) throw QifRepeated{name, child, found->line, element.line};
    found = &element;
  }
  return found;
}

const std::string& QifElement::ChildText(const std::string& child) const {
  static const std::string kEmpty;
  const QifElement* element = Child(child);
  return element == nullptr ? kEmpty : element->text;
}

std::string QifPersistentId(const QifElement& characteristic) {
  const QifElement* designator = characteristic.Child("CharacteristicDesignator");
  if (designator != nullptr && !designator->ChildText("UUID").empty())
    return absl::AsciiStrToLower(designator->ChildText("UUID"));
  const QifElement* attributes = characteristic.Child("Attributes");
  if (attributes == nullptr) return "";
  for (const QifElement& attribute : attributes->children) {
    if (attribute.name == "AttributeQPId")
      return absl::AsciiStrToLower(attribute.ChildText("Value"));
  }
  return "";
}

absl::StatusOr<QifElement> ReadQifXml(const std::string& file, const std::string& schema_folder,
                                      std::span<const char* const> kept) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return absl::NotFoundError(file + ": no such file");
  const uintmax_t bytes = fs::file_size(file, error);
  if (error || bytes > kMaxBytes) {
    return absl::InvalidArgumentError(file + ": larger than 1 GiB; cannot be read");
  }
  SIGHTLINE_RETURN_IF_ERROR(RefuseNul(file));
  std::optional<fs::path> schema;
  fs::path real_schema_folder;
  if (!schema_folder.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(schema, SchemaFile(schema_folder));
    real_schema_folder = fs::canonical(schema_folder);
  }
  InitialiseXerces();
  try {
    Handler handler(file, real_schema_folder, kept);
    // The implementation by name: only it takes a resolver that learns who asks.
    const auto reader = std::make_unique<xc::SAX2XMLReaderImpl>();
    xc::SecurityManager limits;
    limits.setEntityExpansionLimit(100);
    reader->setProperty(xc::XMLUni::fgXercesSecurityManager, &limits);
    reader->setFeature(xc::XMLUni::fgSAX2CoreNameSpaces, true);
    reader->setFeature(xc::XMLUni::fgXercesLoadExternalDTD, false);
    // Schemas are those loaded below, never those the document asks for.
    reader->setFeature(xc::XMLUni::fgXercesLoadSchema, false);
    reader->setFeature(xc::XMLUni::fgSAX2CoreValidation, schema.has_value());
    reader->setFeature(xc::XMLUni::fgXercesDynamic, false);
    reader->setFeature(xc::XMLUni::fgXercesSchema, schema.has_value());
    reader->setContentHandler(&handler);
    reader->setLexicalHandler(&handler);
    reader->setXMLEntityResolver(&handler);
    reader->setErrorHandler(&handler);
    if (schema) {
      handler.set_loading_schema(true);
      reader->setFeature(xc::XMLUni::fgXercesLoadSchema, true);
      const std::u16string path = Utf16(schema->string());
      const xc::LocalFileInputSource source(path.c_str());
      if (reader->loadGrammar(source, xc::Grammar::SchemaGrammarType, true) == nullptr) {
        return absl::InvalidArgumentError(schema->string() + ": not a schema that can be read");
      }
      handler.set_loading_schema(false);
      reader->setFeature(xc::XMLUni::fgXercesLoadSchema, false);
      reader->setFeature(xc::XMLUni::fgXercesUseCachedGrammarInParse, true);
    }
    const std::u16string path = Utf16(fs::absolute(file).string());
    const xc::LocalFileInputSource source(path.c_str());
    reader->parse(source);
    if (!handler.complete()) return absl::InvalidArgumentError(file + ": not a QIF document");
    return handler.Take();
  } catch (const Stop& stop) {
    return stop.status;
  } catch (const xc::OutOfMemoryException&) {
    return absl::InvalidArgumentError(file + ": too large for the memory");
  } catch (const xc::XMLException& exception) {
    return absl::InvalidArgumentError(file + ": " + Utf8(exception.getMessage()));
  } catch (const xc::SAXException& exception) {
    return absl::InvalidArgumentError(file + ": " + Utf8(exception.getMessage()));
  }
}

}  // namespace sightline
