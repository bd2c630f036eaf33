// SPDX-License-Identifier: Apache-2.0
#include "report/html.h"

#include <algorithm>

namespace blindcorner {

namespace embedded {
std::string_view report_asset(std::string_view name);
}

namespace {

/// The text of the last heading before a place, without the tags inside of it.
std::string heading_before(const std::string& body, std::size_t place) {
  const std::size_t begin = body.rfind("<h2", place);
  if (begin == std::string::npos) return {};
  std::string text;
  bool inside = false;
  for (const char character : body.substr(begin, body.find("</h2", begin) - begin)) {
    if (character == '<') inside = true;
    if (!inside) text += character == '"' ? '\'' : character;
    if (character == '>') inside = false;
  }
  return text;
}

/// Puts each table into a box that scrolls where the page is narrower than the table.
std::string with_scrolling_tables(const std::string& body) {
  constexpr std::string_view kBegin = "<table", kEnd = "</table>";
  std::string wrapped;
  std::size_t from = 0;
  while (from < body.size()) {
    const std::size_t begin = body.find(kBegin, from), end = body.find(kEnd, from);
    const std::size_t next = std::min(begin, end);
    if (next == std::string::npos) break;
    wrapped.append(body, from, next - from);
    if (next == begin) {
      const std::string heading = heading_before(body, begin);
      wrapped += scroll_box("table" + (heading.empty() ? "" : ": " + heading)) + "<table";
    } else {
      wrapped += "</table></div>";
    }
    from = next + (next == begin ? kBegin.size() : kEnd.size());
  }
  return wrapped.append(body, from);
}

/// The head up to the page's own style: what a browser has to know, and what a list of pages shows.
std::string head_of(const std::string& title, const std::string& headline) {
  std::string head =
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  head.append(kGenerator) += "\n<title>" + html_safe(title) + "</title>\n";
  if (!headline.empty()) {
    head += "<meta name=\"description\" content=\"" + html_safe(headline) + "\">\n";
  }
  head += "<style>\n";
  return head.append(embedded::report_asset("theme.css"));
}

/// JSON that may stand inside a script element: without "<", nothing in it opens or closes an
/// element.
std::string script_safe(const std::string& text) {
  std::string safe;
  safe.reserve(text.size());
  for (const char character : text) {
    if (character == '<') {
      safe += "\\u003c";
    } else {
      safe += character;
    }
  }
  return safe;
}

}  // namespace

std::string html_safe(const std::string& text) {
  std::string safe;
  for (const char character : text) {
    switch (character) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += character;
    }
  }
  return safe;
}

std::string scroll_box(const std::string& label) {
  return "<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"" + label + "\">";
}

std::string plain_page(const std::string& title, const std::string& headline,
                       const std::string& body) {
  std::string page = head_of(title, headline);
  page += embedded::report_asset("plain_page.css");
  page += "</style></head>\n<body><main>\n<h1>" + html_safe(title) + "</h1>\n";
  if (!headline.empty()) page += "<p class=\"headline\">" + html_safe(headline) + "</p>\n";
  return page + with_scrolling_tables(body) + "</main></body></html>\n";
}

void add_styles(const PageAssets& assets, std::string& page) {
  for (const std::string_view style : assets.styles) page += embedded::report_asset(style);
}

/// Adds one script element after another, beginning in an open <script tag. A last such tag stays
/// open, for the attributes that the data need.
void add_libraries(const PageAssets& assets, std::string& page) {
  for (const std::string_view library : assets.libraries) {
    page += ">\n";
    page.append(embedded::report_asset(library)) += "\n</script>\n<script";
  }
}

std::string script_part(const std::string& id, const std::string& data, const PageAssets& assets) {
  std::string part = "<style>\n";
  add_styles(assets, part);
  part += "</style>\n<script";
  add_libraries(assets, part);
  part += " type=\"application/json\" id=\"" + html_safe(id) + "\">" + script_safe(data);
  part.append("</script>\n<script>\n").append(embedded::report_asset(assets.script));
  return part + "</script>\n";
}

std::string script_page(const std::string& title, const std::string& headline,
                        const std::string& data, const PageAssets& assets) {
  std::string page = head_of(title, headline);
  add_styles(assets, page);
  page +=
      "</style>\n</head>\n<body>\n<main id=\"page\"></main>\n<noscript>This page draws its "
      "pictures with JavaScript.</noscript>\n<script";
  add_libraries(assets, page);
  page += " type=\"application/json\" id=\"data\">" + script_safe(data);
  page += "</script>\n<script>\n";
  page += embedded::report_asset(assets.script);
  page += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace blindcorner
