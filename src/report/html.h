// SPDX-License-Identifier: Apache-2.0
/// What all pages share: safe text, and a plain page that needs no script.
#pragma once

#include <string>

namespace blindcorner {

/// Text for HTML and SVG, in elements or in quoted attributes.
std::string html_safe(const std::string& text);

/// A self-contained page: the title as its heading, then the body, which is HTML already.
std::string plain_page(const std::string& title, const std::string& body);

}  // namespace blindcorner
