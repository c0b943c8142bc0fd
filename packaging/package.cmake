# What is installed where, and the Debian package made of it: `cmake --install build --prefix DIR`, `cpack` in the build
# folder. Programs find their data in ../share/fluorocut (core/io/resources.h).
include(GNUInstallDirs)
set(documents ${CMAKE_INSTALL_DATADIR}/doc/fluorocut)
find_program(FLUOROCUT_GZIP gzip REQUIRED)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # a package needs no tests
add_custom_target(package-files ALL)

add_dependencies(package-files fluorocut-cli manual)
install(TARGETS fluorocut-cli DESTINATION ${CMAKE_INSTALL_BINDIR})
foreach(kind fiducials implants phantoms plates scenarios)
    install(DIRECTORY resources/${kind} DESTINATION ${CMAKE_INSTALL_DATADIR}/fluorocut FILES_MATCHING PATTERN *.json)
endforeach()
install(FILES packaging/share/copyright DESTINATION ${documents})

# Compressed as Debian asks for it, without a time in it: the same sources give the same file.
function(fluorocut_install_compressed source destination name)
    set(made ${CMAKE_BINARY_DIR}/packaging/${name}.gz)
    add_custom_command(OUTPUT ${made} COMMAND ${FLUOROCUT_GZIP} -9 -n -c ${source} > ${made} DEPENDS ${source} VERBATIM)
    add_custom_target(compressed-${name} DEPENDS ${made})
    add_dependencies(package-files compressed-${name})
    install(FILES ${made} DESTINATION ${destination})
endfunction()
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/packaging)
fluorocut_install_compressed(${PROJECT_SOURCE_DIR}/packaging/share/changelog ${documents} changelog)
fluorocut_install_compressed(${CMAKE_BINARY_DIR}/app/cli/fluorocut-cli.1 ${CMAKE_INSTALL_MANDIR}/man1 fluorocut-cli.1)
add_dependencies(compressed-fluorocut-cli.1 manual)
set(completions ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${CMAKE_BINARY_DIR}/app/cli/fluorocut-cli.bash DESTINATION ${completions} RENAME fluorocut-cli)

if(FLUOROCUT_UI)
    add_dependencies(package-files fluorocut)
    install(TARGETS fluorocut DESTINATION ${CMAKE_INSTALL_BINDIR})
    install(DIRECTORY resources/help resources/icons DESTINATION ${CMAKE_INSTALL_DATADIR}/fluorocut)
    install(FILES resources/icons/fluorocut.svg
            DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps)
    foreach(size 48 128)
        install(FILES resources/icons/fluorocut-${size}.png RENAME fluorocut.png
                DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/${size}x${size}/apps)
    endforeach()
    install(FILES packaging/share/org.fluorocut.FluoroCut.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
    install(FILES packaging/share/org.fluorocut.FluoroCut.metainfo.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo)
    install(FILES packaging/share/fluorocut-case.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/mime/packages)
    install(FILES packaging/share/fluorocut.bash DESTINATION ${completions} RENAME fluorocut)
    configure_file(packaging/share/fluorocut.1.in packaging/fluorocut.1 @ONLY)
    fluorocut_install_compressed(${CMAKE_BINARY_DIR}/packaging/fluorocut.1 ${CMAKE_INSTALL_MANDIR}/man1 fluorocut.1)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME fluorocut)
set(CPACK_PACKAGE_VENDOR "FluoroCut")
set(CPACK_PACKAGE_CONTACT "The FluoroCut maintainers <maintainers@fluorocut.example.org>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "plan and guide revision hip replacement with a C-arm")
set(CPACK_PACKAGE_DESCRIPTION
"FluoroCut plans the cavity for a femoral implant on fluoroscopic images and
guides a robot that mills it in stages. After each stage the C-arm looks
again, the cavity's true place is found in the images, and the next, larger
stage corrects what the last one missed.
.
This package holds the desktop (fluorocut), the command line (fluorocut-cli)
and a virtual operating room in which every step can be tried.
.
Research software, not a medical device.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # what the programs are linked with; by dpkg-shlibdeps
# What they load while they run: without any font the desktop shows no text.
set(CPACK_DEBIAN_PACKAGE_DEPENDS "fonts-dejavu-core")
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
include(CPack)
