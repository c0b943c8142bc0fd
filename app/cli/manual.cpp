#include "app/cli/manual.h"

#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace fluorocut::cli {
namespace {

std::vector<const CLI::App*> below(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App* sub) { return !sub->get_name().empty(); });
}

bool isHelp(const CLI::Option& option) {
    return option.check_lname("help");
}

// "-o", "--out", in the order of declaration, without the help that all have.
std::vector<const CLI::Option*> optionsOf(const CLI::App& app) {
    return app.get_options([](const CLI::Option* option) { return option->nonpositional() && !isHelp(*option); });
}

std::vector<std::string> namesOf(const CLI::Option& option) {
    std::vector<std::string> names;
    for (const std::string& name : option.get_snames())
        names.push_back("-" + name);
    for (const std::string& name : option.get_lnames())
        names.push_back("--" + name);
    return names;
}

bool takesValue(const CLI::Option& option) {
    return option.get_items_expected_max() > 0;  // a flag takes none
}

// Of "TEXT:{ap,lateral}": ap, lateral.
std::vector<std::string> choicesOf(const CLI::Option& option) {
    const std::string type = option.get_type_name();
    const std::size_t open = type.find('{'), close = type.rfind('}');
    if (open == std::string::npos || close == std::string::npos) return {};
    return CLI::detail::split(type.substr(open + 1, close - open - 1), ',');
}

std::string joined(const std::vector<std::string>& words, std::string_view between = " ") {
    return fmt::format("{}", fmt::join(words, between));
}

// ---- roff

// Of text that is set as it stands: hyphens stay hyphens, nothing at a line's beginning is a request.
std::string roff(std::string_view text) {
    std::string out;
    bool begins = true;
    for (const char c : text) {
        if (begins && (c == '.' || c == '\'')) out += "\\&";
        begins = c == '\n';
        if (c == '\\')
            out += "\\e";
        else if (c == '-')
            out += "\\-";
        else
            out += c;
    }
    return out;
}

std::string optionEntry(const CLI::Option& option) {
    std::string head;
    for (const std::string& name : namesOf(option))
        head += fmt::format("{}\\fB{}\\fR", head.empty() ? "" : ", ", roff(name));
    std::string about = option.get_description();
    if (takesValue(option)) {
        const std::string type = option.get_type_name();
        head += fmt::format(" \\fI{}\\fR", roff(type.substr(0, type.find(':'))));
        if (option.get_expected_max() > 1 || option.get_type_size() > 1) head += " ...";
        if (const auto choices = choicesOf(option); !choices.empty())
            about += fmt::format("{}one of {}", about.empty() ? "" : "; ", joined(choices, ", "));
        if (!option.get_default_str().empty()) about += fmt::format(" (default: {})", option.get_default_str());
        if (option.get_required()) about += " (required)";
    }
    return fmt::format(".TP\n{}\n{}\n", head, roff(about));
}

std::string synopsis(const CLI::App& app, const std::string& path) {
    std::string line = fmt::format("\\fB{}\\fR", roff(path));
    if (!optionsOf(app).empty()) line += " [\\fIOPTIONS\\fR]";
    for (const CLI::Option* option : app.get_options([](const CLI::Option* o) { return o->get_positional(); })) {
        const std::string shown =
            fmt::format("\\fI{}\\fR{}", roff(option->get_name(true)), option->get_expected_max() > 1 ? " ..." : "");
        line += option->get_required() ? " " + shown : " [" + shown + "]";
    }
    return line;
}

// The footer: its lines as they stand, for there are examples in it.
std::string remarks(const CLI::App& app) {
    const std::string footer = app.get_footer();
    const std::size_t first = footer.find_first_not_of('\n');
    return first == std::string::npos ? std::string() : fmt::format(".PP\n.nf\n{}\n.fi\n", roff(footer.substr(first)));
}

void describe(const CLI::App& app, const std::string& path, std::string& page) {
    page += fmt::format(".SS \"{}\"\n{}\n", roff(path), roff(app.get_description()));
    const auto commands = below(app);
    if (commands.empty()) page += fmt::format(".PP\n{}\n", synopsis(app, "fluorocut-cli " + path));
    for (const CLI::Option* option : app.get_options([](const CLI::Option* o) { return o->get_positional(); })) {
        page += fmt::format(".TP\n\\fI{}\\fR\n{}\n", roff(option->get_name(true)), roff(option->get_description()));
    }
    for (const CLI::Option* option : optionsOf(app))
        page += optionEntry(*option);
    page += remarks(app);
    for (const CLI::App* command : commands)
        describe(*command, path + " " + command->get_name(), page);
}

// ---- bash

void complete(const CLI::App& app, const std::string& path, std::vector<std::string>& paths, std::string& values,
              std::string& words) {
    std::vector<std::string> offered, options{"--help"};
    for (const CLI::App* command : below(app))
        offered.push_back(command->get_name());
    if (!path.empty()) options.emplace_back("--json");  // of the program, understood by every command
    for (const CLI::Option* option : optionsOf(app)) {
        const std::vector<std::string> names = namesOf(*option);
        options.insert(options.end(), names.begin(), names.end());
        if (!takesValue(*option)) continue;
        std::vector<std::string> patterns;
        for (const std::string& name : names)
            patterns.push_back(fmt::format("\"{} {}\"", path, name));
        values += fmt::format("        {}) words=\"{}\"; takes=value ;;\n", joined(patterns, " | "),
                              joined(choicesOf(*option)));
    }
    words +=
        fmt::format("        \"{}\") commands=\"{}\"; options=\"{}\" ;;\n", path, joined(offered), joined(options));
    for (const CLI::App* command : below(app)) {
        const std::string next = path + " " + command->get_name();
        paths.push_back(fmt::format("\"{}\"", next));
        complete(*command, next, paths, values, words);
    }
}

}  // namespace

std::string manualPage(const CLI::App& app, const std::string& version) {
    std::string page = fmt::format(
        ".\\\" Made from the program's own declarations.\n"
        ".TH FLUOROCUT\\-CLI 1 \"\" \"FluoroCut {}\" \"FluoroCut\"\n"
        ".SH NAME\nfluorocut\\-cli \\- C\\-arm images, their geometry, and the cavity they guide, without a screen\n"
        ".SH SYNOPSIS\n\\fBfluorocut\\-cli\\fR \\fICOMMAND\\fR [\\fIOPTIONS\\fR]\n"
        ".SH DESCRIPTION\n{}\n.SH OPTIONS\n.TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR\n"
        "Tell about the program, or about the command that stands before it\n",
        roff(version), roff(app.get_description()));
    for (const CLI::Option* option : optionsOf(app))
        page += optionEntry(*option);
    page += ".SH COMMANDS\n";
    for (const CLI::App* command : below(app))
        describe(*command, command->get_name(), page);
    page += ".SH EXIT STATUS\n.nf\n" + roff(app.get_footer()) + "\n.fi\n";
    page +=
        ".SH ENVIRONMENT\n.TP\n\\fBFLUOROCUT_RESOURCES\\fR\n"
        "Folder with plates, phantoms, implants and scenarios, instead of the one that was installed\n"
        ".SH SEE ALSO\n\\fBfluorocut\\fR(1)\n";
    return page;
}

std::string bashCompletion(const CLI::App& app) {
    std::vector<std::string> paths;
    std::string values, words;
    complete(app, "", paths, values, words);
    return fmt::format(
        R"(# Completion for fluorocut-cli, made from the program's own declarations.
_fluorocut_cli() {{
    local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}}
    local path="" words="" takes="" commands="" options="" i
    for ((i = 1; i < COMP_CWORD; ++i)); do
        case "$path ${{COMP_WORDS[i]}}" in
        {}) path="$path ${{COMP_WORDS[i]}}" ;;
        esac
    done
    case "$path $previous" in
{}    esac
    case "$path" in
{}    esac
    if [[ $takes != value ]]; then
        if [[ $current == -* ]]; then words=$options; else words=$commands; fi
    fi
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o bashdefault -o default -F _fluorocut_cli fluorocut-cli
)",
        joined(paths, " | "), values, words);
}

}  // namespace fluorocut::cli
