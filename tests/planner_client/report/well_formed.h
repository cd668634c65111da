// What every page must be, whatever it says.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace sightline {

// Empty if all elements of the page are closed in order, attributes are quoted and hold
// neither "nan" nor "inf", ampersands begin entities and ids are unique; otherwise what is wrong.
std::string MarkupFault(const std::string& html);

// Sets every text anywhere in the message; every floating-point number.
void SetAllTexts(google::protobuf::Message* message, const std::string& text);
void SetAllNumbers(google::protobuf::Message* message, double value);

}  // namespace sightline
