// SPDX-License-Identifier: Apache-2.0
#include "planning_service/access/certificate_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/asn1.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <memory>
#include <string>
#include <vector>

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Certificate = std::unique_ptr<X509, void (*)(X509*)>;

// A certificate with these names; `alternative_names` as OpenSSL writes them, empty: none.
Certificate MakeCertificate(const std::vector<std::string>& common_names,
                            const std::string& alternative_names) {
  Certificate certificate(X509_new(), X509_free);
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  for (const std::string& name : common_names) {
    EXPECT_EQ(X509_NAME_add_entry_by_NID(subject, NID_commonName, MBSTRING_UTF8,
                                         reinterpret_cast<const unsigned char*>(name.data()),
                                         static_cast<int>(name.size()), -1, 0),
              1);
  }
  if (!alternative_names.empty()) {
    X509_EXTENSION* extension =
        X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, alternative_names.c_str());
    EXPECT_NE(extension, nullptr);
    X509_add_ext(certificate.get(), extension, -1);
    X509_EXTENSION_free(extension);
  }
  return certificate;
}

std::vector<std::string> Names(const std::vector<std::string>& common_names,
                               const std::string& alternative_names = "") {
  return CertificateNames(MakeCertificate(common_names, alternative_names).get());
}

TEST(CertificateNames, AreTheAlternativeNamesIfThereAreAny) {
  EXPECT_THAT(Names({"admin"}, "DNS:line.plant,URI:spiffe://plant/line,email:a@b.c,IP:10.0.0.3"),
              ElementsAre("line.plant", "spiffe://plant/line", "a@b.c", "10.0.0.3"));
  // A type that names nobody here is an alternative name all the same.
  EXPECT_THAT(Names({"admin"}, "RID:1.2.3.4"), IsEmpty());
}

TEST(CertificateNames, AreElseTheOneCommonName) {
  EXPECT_THAT(Names({"gateway"}), ElementsAre("gateway"));
  EXPECT_THAT(Names({}), IsEmpty());
  EXPECT_THAT(Names({"admin", "line"}), IsEmpty());
  EXPECT_THAT(Names({"line", "line"}), IsEmpty());
}

TEST(CertificateNames, LeaveOutControlCharacters) {
  EXPECT_THAT(Names({std::string("admin\0.plant", 12)}), IsEmpty());
  EXPECT_THAT(Names({"admin\n"}), IsEmpty());
}

TEST(CertificateNames, OfAnUnreadableExtensionAreNone) {
  const Certificate certificate = MakeCertificate({"admin"}, "");
  const std::unique_ptr<ASN1_OCTET_STRING, void (*)(ASN1_OCTET_STRING*)> bytes(
      ASN1_OCTET_STRING_new(), ASN1_OCTET_STRING_free);
  ASN1_OCTET_STRING_set(bytes.get(), reinterpret_cast<const unsigned char*>("nonsense"), 8);
  X509_EXTENSION* extension =
      X509_EXTENSION_create_by_NID(nullptr, NID_subject_alt_name, 0, bytes.get());
  X509_add_ext(certificate.get(), extension, -1);
  X509_EXTENSION_free(extension);
  EXPECT_THAT(CertificateNames(certificate.get()), IsEmpty());
}

TEST(CertificateNames, OfTextThatIsNoCertificateAreNone) {
  EXPECT_THAT(CertificateNamesOfPem(""), IsEmpty());
  EXPECT_THAT(CertificateNamesOfPem("-----BEGIN CERTIFICATE-----\nAAAA\n"), IsEmpty());
  EXPECT_THAT(CertificateNames(nullptr), IsEmpty());
}

}  // namespace
}  // namespace sightline
