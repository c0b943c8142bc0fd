# Completion for fluorocut: options; files elsewhere.
_fluorocut() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} words=""
    case "$previous" in
        --language) words="en de" ;;
        --screenshot | --size) ;;
        *) if [[ $current == -* ]]; then words="--help --help-all --version --screenshot --size --language"; fi ;;
    esac
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}
complete -o bashdefault -o default -F _fluorocut fluorocut
