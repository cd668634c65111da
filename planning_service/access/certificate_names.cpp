// SPDX-License-Identifier: Apache-2.0
#include "planning_service/access/certificate_names.h"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace sightline {
namespace {

constexpr int kMaxNames = 100;

void AddName(const ASN1_STRING* text, std::vector<std::string>* names) {
  unsigned char* utf8 = nullptr;
  const int length = text == nullptr ? -1 : ASN1_STRING_to_UTF8(&utf8, text);
  if (length > 0) {
    std::string name(reinterpret_cast<const char*>(utf8), static_cast<size_t>(length));
    const bool is_plain = std::none_of(name.begin(), name.end(), [](char c) {
      return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    });
    if (is_plain && std::find(names->begin(), names->end(), name) == names->end()) {
      names->push_back(std::move(name));
    }
  }
  OPENSSL_free(utf8);
}

void AddAddress(const ASN1_OCTET_STRING& bytes, std::vector<std::string>* names) {
  char text[INET6_ADDRSTRLEN] = "";
  const int length = ASN1_STRING_length(&bytes);
  const int family = length == 4 ? AF_INET : length == 16 ? AF_INET6 : AF_UNSPEC;
  if (family != AF_UNSPEC &&
      inet_ntop(family, ASN1_STRING_get0_data(&bytes), text, sizeof(text)) != nullptr) {
    names->push_back(text);
  }
}

std::vector<std::string> AlternativeNames(const GENERAL_NAMES* alternatives) {
  std::vector<std::string> names;
  for (int i = 0; i < std::min(sk_GENERAL_NAME_num(alternatives), kMaxNames); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(alternatives, i);
    if (name->type == GEN_DNS) AddName(name->d.dNSName, &names);
    if (name->type == GEN_URI) AddName(name->d.uniformResourceIdentifier, &names);
    if (name->type == GEN_EMAIL) AddName(name->d.rfc822Name, &names);
    if (name->type == GEN_IPADD) AddAddress(*name->d.iPAddress, &names);
  }
  return names;
}

}  // namespace

std::vector<std::string> CertificateNames(const X509* certificate) {
  if (certificate == nullptr) return {};
  // -1: the certificate has no such extension; -2: it has several, >= 0: it cannot be read.
  int reason = 0;
  const std::unique_ptr<GENERAL_NAMES, void (*)(GENERAL_NAMES*)> alternatives(
      static_cast<GENERAL_NAMES*>(
          X509_get_ext_d2i(certificate, NID_subject_alt_name, &reason, nullptr)),
      GENERAL_NAMES_free);
  if (alternatives != nullptr) return AlternativeNames(alternatives.get());
  std::vector<std::string> names;
  if (reason != -1) return names;
  const X509_NAME* subject = X509_get_subject_name(certificate);
  const int first = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  if (first < 0 || X509_NAME_get_index_by_NID(subject, NID_commonName, first) >= 0) return names;
  AddName(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, first)), &names);
  return names;
}

std::vector<std::string> CertificateNamesOfPem(std::string_view pem) {
  const std::unique_ptr<BIO, int (*)(BIO*)> text(
      BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())), BIO_free);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(
      text == nullptr ? nullptr : PEM_read_bio_X509(text.get(), nullptr, nullptr, nullptr),
      X509_free);
  ERR_clear_error();
  return CertificateNames(certificate.get());
}

}  // namespace sightline
