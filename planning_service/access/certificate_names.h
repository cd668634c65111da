// SPDX-License-Identifier: Apache-2.0
// Names by which a client certificate identifies a client, the same for gRPC and HTTP.
//
// RFC 6125 6.4.4: if a certificate has subject alternative names, only these count, not the common
// name. Without them the common name counts if there is exactly one: among several it is unknown
// which one the authority has checked.
#pragma once

#include <openssl/types.h>

#include <string>
#include <string_view>
#include <vector>

namespace sightline {

// Alternative names of type DNS, URI, email and IP address (at most 100), or the common name. Names
// with control characters are left out: a NUL inside would let "admin\0.example" pass for another.
// A certificate whose alternative names cannot be read has no names.
std::vector<std::string> CertificateNames(const X509* certificate);

// The same for the first certificate of a PEM text; empty if the text has none.
std::vector<std::string> CertificateNamesOfPem(std::string_view pem);

}  // namespace sightline
