// SPDX-License-Identifier: Apache-2.0
/// What all pages share: safe text, a plain page that needs no script, and one that a script draws.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace blindcorner {

/// Stands in the head of every page and tells it from pages of other programs.
inline constexpr std::string_view kGenerator = "<meta name=\"generator\" content=\"blindcorner\">";

/// Text for HTML and SVG, in elements or in quoted attributes.
std::string html_safe(const std::string& text);

/// A self-contained page: the title as its heading, a sentence that says for any reader what came
/// out (empty: none), then the body, which is HTML already.
std::string plain_page(const std::string& title, const std::string& headline,
                       const std::string& body);

/// Opens an element that scrolls sideways, also by keyboard, where the page is narrower than its
/// content. The label (HTML already) says what the content is. The caller ends it with </div>.
std::string scroll_box(const std::string& label);

/// Names of the files that are embedded into the program for a page.
struct PageAssets {
  std::vector<std::string_view> styles;     ///< beside theme.css, which all pages have
  std::vector<std::string_view> libraries;  ///< scripts that stand before the data
  std::string_view script;                  ///< draws the data into the element "page"
};

/// A part of a plain page that a script draws: its style, its data (JSON, in an element with this
/// id) and its scripts.
std::string script_part(const std::string& id, const std::string& data, const PageAssets& assets);

/// A self-contained page that a script draws; `data` is JSON. The headline goes into the head for
/// lists of pages; the script draws the visible one from the data.
std::string script_page(const std::string& title, const std::string& headline,
                        const std::string& data, const PageAssets& assets);

}  // namespace blindcorner
