<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de" sourcelanguage="en">
<context>
    <name>CaseSteps</name>
    <message>
        <source>Calibrate C-arm</source>
        <translation>C-Bogen kalibrieren</translation>
    </message>
    <message>
        <source>not calibrated</source>
        <translation>nicht kalibriert</translation>
    </message>
    <message>
        <source>Images before</source>
        <translation>Bilder vorher</translation>
    </message>
    <message numerus="yes">
        <source>%n view(s)</source>
        <translation>
            <numerusform>%n Ansicht</numerusform>
            <numerusform>%n Ansichten</numerusform>
        </translation>
    </message>
    <message>
        <source>Registration</source>
        <translation>Registrierung</translation>
    </message>
    <message>
        <source>needs images</source>
        <translation>braucht Bilder</translation>
    </message>
    <message>
        <source>no view is registered</source>
        <translation>keine Ansicht ist registriert</translation>
    </message>
    <message>
        <source>%1 of %2 views, worst %3 mm</source>
        <translation>%1 von %2 Ansichten, schlechteste %3 mm</translation>
    </message>
    <message>
        <source>Plan</source>
        <translation>Plan</translation>
    </message>
    <message>
        <source>no implant is chosen</source>
        <translation>kein Implantat gewählt</translation>
    </message>
    <message>
        <source>%1: the cavities are to be worked out</source>
        <translation>%1: die Höhlen sind neu zu berechnen</translation>
    </message>
    <message>
        <source>%1 mm inside the final cavity</source>
        <translation>%1 mm innerhalb der endgültigen Höhle</translation>
    </message>
    <message>
        <source>the final cavity</source>
        <translation>die endgültige Höhle</translation>
    </message>
    <message>
        <source>Cut %1</source>
        <translation>Schnitt %1</translation>
    </message>
    <message>
        <source>Images after cut %1</source>
        <translation>Bilder nach Schnitt %1</translation>
    </message>
    <message>
        <source>Locate cavity %1</source>
        <translation>Höhle %1 orten</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::Autosave</name>
    <message>
        <source>Save as</source>
        <translation>Speichern unter</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::HelpWindow</name>
    <message>
        <source>FluoroCut: help</source>
        <translation>FluoroCut: Hilfe</translation>
    </message>
    <message>
        <source>Pages</source>
        <translation>Seiten</translation>
    </message>
    <message>
        <source>The help page &quot;%1&quot; is missing: %2</source>
        <translation>Die Hilfeseite „%1“ fehlt: %2</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::MainWindow</name>
    <message>
        <source>&amp;File</source>
        <translation>&amp;Datei</translation>
    </message>
    <message>
        <source>&amp;Open...</source>
        <translation>Ö&amp;ffnen...</translation>
    </message>
    <message>
        <source>Open &amp;recent</source>
        <translation>&amp;Zuletzt geöffnet</translation>
    </message>
    <message>
        <source>&amp;Clear this list</source>
        <translation>Liste &amp;leeren</translation>
    </message>
    <message>
        <source>Open the &amp;sample case</source>
        <translation>&amp;Beispielfall öffnen</translation>
    </message>
    <message>
        <source>Save case &amp;as...</source>
        <translation>Fall speichern &amp;unter...</translation>
    </message>
    <message>
        <source>S&amp;ettings...</source>
        <translation>&amp;Einstellungen...</translation>
    </message>
    <message>
        <source>&amp;Quit</source>
        <translation>&amp;Beenden</translation>
    </message>
    <message>
        <source>&amp;Edit</source>
        <translation>&amp;Bearbeiten</translation>
    </message>
    <message>
        <source>&amp;Undo</source>
        <translation>&amp;Rückgängig</translation>
    </message>
    <message>
        <source>&amp;Redo</source>
        <translation>&amp;Wiederholen</translation>
    </message>
    <message>
        <source>&amp;Undo: %1</source>
        <translation>&amp;Rückgängig: %1</translation>
    </message>
    <message>
        <source>&amp;Redo: %1</source>
        <translation>&amp;Wiederholen: %1</translation>
    </message>
    <message>
        <source>&amp;View</source>
        <translation>&amp;Ansicht</translation>
    </message>
    <message>
        <source>&amp;Start page</source>
        <translation>&amp;Startseite</translation>
    </message>
    <message>
        <source>&amp;Case</source>
        <translation>&amp;Fall</translation>
    </message>
    <message>
        <source>&amp;Reset layout</source>
        <translation>Anordnung &amp;zurücksetzen</translation>
    </message>
    <message>
        <source>&amp;Look</source>
        <translation>&amp;Aussehen</translation>
    </message>
    <message>
        <source>&amp;Dark</source>
        <translation>&amp;Dunkel</translation>
    </message>
    <message>
        <source>&amp;Light</source>
        <translation>&amp;Hell</translation>
    </message>
    <message>
        <source>&amp;Operating room (large)</source>
        <translation>&amp;Operationssaal (groß)</translation>
    </message>
    <message>
        <source>&amp;Full screen</source>
        <translation>&amp;Vollbild</translation>
    </message>
    <message>
        <source>&amp;Help</source>
        <translation>&amp;Hilfe</translation>
    </message>
    <message>
        <source>&amp;Help for this place</source>
        <translation>&amp;Hilfe zu dieser Stelle</translation>
    </message>
    <message>
        <source>&amp;Shortcuts</source>
        <translation>&amp;Tastenkürzel</translation>
    </message>
    <message>
        <source>&amp;About FluoroCut</source>
        <translation>&amp;Über FluoroCut</translation>
    </message>
    <message>
        <source>About FluoroCut</source>
        <translation>Über FluoroCut</translation>
    </message>
    <message>
        <source>FluoroCut %1

C-arm guided planning and robotic milling of the femoral cavity.

Research software, not a medical device.</source>
        <translation>FluoroCut %1

Planung am C-Bogen und Fräsen der Femurhöhle durch einen Roboter.

Forschungssoftware, kein Medizinprodukt.</translation>
    </message>
    <message>
        <source>Open images, CT, mesh or case</source>
        <translation>Bilder, CT, Netz oder Fall öffnen</translation>
    </message>
    <message>
        <source>All that can be opened (*.fluorocut *.png *.tif *.tiff *.dcm *.mha *.nrrd *.nii *.nii.gz *.stl *.obj *.ply)</source>
        <translation>Alles, was geöffnet werden kann (*.fluorocut *.png *.tif *.tiff *.dcm *.mha *.nrrd *.nii *.nii.gz *.stl *.obj *.ply)</translation>
    </message>
    <message>
        <source>All files (*)</source>
        <translation>Alle Dateien (*)</translation>
    </message>
    <message>
        <source>Save case as</source>
        <translation>Fall speichern unter</translation>
    </message>
    <message>
        <source>Cases (*.fluorocut)</source>
        <translation>Fälle (*.fluorocut)</translation>
    </message>
    <message>
        <source>today</source>
        <translation>heute</translation>
    </message>
    <message numerus="yes">
        <source>%n day(s) ago</source>
        <translation>
            <numerusform>vor %n Tag</numerusform>
            <numerusform>vor %n Tagen</numerusform>
        </translation>
    </message>
    <message>
        <source>FluoroCut has a fault of its own (%1); please report it.</source>
        <translation>FluoroCut hat einen eigenen Fehler (%1); bitte melden.</translation>
    </message>
    <message>
        <source>Saving...</source>
        <translation>Wird gespeichert...</translation>
    </message>
    <message>
        <source>Saved</source>
        <translation>Gespeichert</translation>
    </message>
    <message>
        <source>Not saved</source>
        <translation>Nicht gespeichert</translation>
    </message>
    <message>
        <source>The case could not be saved: %1</source>
        <translation>Der Fall konnte nicht gespeichert werden: %1</translation>
    </message>
    <message>
        <source>Procedure</source>
        <translation>Eingriff</translation>
    </message>
    <message>
        <source>Plan</source>
        <translation>Plan</translation>
    </message>
    <message>
        <source>3D</source>
        <translation>3D</translation>
    </message>
    <message>
        <source>Patient and side</source>
        <translation>Patient und Seite</translation>
    </message>
    <message>
        <source>Calibration</source>
        <translation>Kalibrierung</translation>
    </message>
    <message>
        <source>Robot</source>
        <translation>Roboter</translation>
    </message>
    <message>
        <source>Notice</source>
        <translation>Hinweis</translation>
    </message>
    <message>
        <source>Research software, not a medical device</source>
        <translation>Forschungssoftware, kein Medizinprodukt</translation>
    </message>
    <message>
        <source>Robot: not connected</source>
        <translation>Roboter: nicht verbunden</translation>
    </message>
    <message>
        <source>No patient</source>
        <translation>Kein Patient</translation>
    </message>
    <message>
        <source>%1, side unknown</source>
        <translation>%1, Seite unbekannt</translation>
    </message>
    <message>
        <source>%1, left</source>
        <translation>%1, links</translation>
    </message>
    <message>
        <source>%1, right</source>
        <translation>%1, rechts</translation>
    </message>
    <message>
        <source>C-arm not calibrated</source>
        <translation>C-Bogen nicht kalibriert</translation>
    </message>
    <message>
        <source>C-arm calibrated %1</source>
        <translation>C-Bogen kalibriert %1</translation>
    </message>
    <message>
        <source>FluoroCut (research software, not a medical device)</source>
        <translation>FluoroCut (Forschungssoftware, kein Medizinprodukt)</translation>
    </message>
    <message>
        <source>%1 - %2</source>
        <translation>%1 – %2</translation>
    </message>
    <message>
        <source>Opening the sample case</source>
        <translation>Beispielfall wird geöffnet</translation>
    </message>
    <message>
        <source>Sample case</source>
        <translation>Beispielfall</translation>
    </message>
    <message numerus="yes">
        <source>%n file(s)</source>
        <translation>
            <numerusform>%n Datei</numerusform>
            <numerusform>%n Dateien</numerusform>
        </translation>
    </message>
    <message>
        <source>Opening %1</source>
        <translation>%1 wird geöffnet</translation>
    </message>
    <message>
        <source>Open %1</source>
        <translation>%1 öffnen</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::MessageBar</name>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::Navigator</name>
    <message>
        <source>waiting</source>
        <translation>wartet</translation>
    </message>
    <message>
        <source>ready</source>
        <translation>bereit</translation>
    </message>
    <message>
        <source>running</source>
        <translation>läuft</translation>
    </message>
    <message>
        <source>done, not yet accepted</source>
        <translation>erledigt, noch nicht angenommen</translation>
    </message>
    <message>
        <source>accepted</source>
        <translation>angenommen</translation>
    </message>
    <message>
        <source>refused</source>
        <translation>abgelehnt</translation>
    </message>
    <message>
        <source>stale</source>
        <translation>veraltet</translation>
    </message>
    <message>
        <source>Steps of the procedure</source>
        <translation>Schritte des Eingriffs</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::SettingsDialog</name>
    <message>
        <source>Settings</source>
        <translation>Einstellungen</translation>
    </message>
    <message>
        <source>Dark</source>
        <translation>Dunkel</translation>
    </message>
    <message>
        <source>Light</source>
        <translation>Hell</translation>
    </message>
    <message>
        <source>Operating room (large)</source>
        <translation>Operationssaal (groß)</translation>
    </message>
    <message>
        <source>As the system</source>
        <translation>Wie das System</translation>
    </message>
    <message>
        <source>The language changes at the next start.</source>
        <translation>Die Sprache wechselt beim nächsten Start.</translation>
    </message>
    <message>
        <source>Choose...</source>
        <translation>Wählen...</translation>
    </message>
    <message>
        <source>Folder for cases</source>
        <translation>Ordner für Fälle</translation>
    </message>
    <message>
        <source>Every edit of a case that has no file yet is saved there, from the next case on.</source>
        <translation>Dort wird jede Änderung eines Falls gespeichert, der noch keine Datei hat; gilt ab dem nächsten Fall.</translation>
    </message>
    <message>
        <source>Look</source>
        <translation>Aussehen</translation>
    </message>
    <message>
        <source>Language</source>
        <translation>Sprache</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::ShortcutsDialog</name>
    <message>
        <source>In an image</source>
        <translation>In einem Bild</translation>
    </message>
    <message>
        <source>Window and level</source>
        <translation>Fensterung</translation>
    </message>
    <message>
        <source>Left drag</source>
        <translation>Links ziehen</translation>
    </message>
    <message>
        <source>Pan</source>
        <translation>Verschieben</translation>
    </message>
    <message>
        <source>Middle drag</source>
        <translation>Mitte ziehen</translation>
    </message>
    <message>
        <source>Zoom</source>
        <translation>Vergrößern</translation>
    </message>
    <message>
        <source>Wheel, right drag</source>
        <translation>Rad, rechts ziehen</translation>
    </message>
    <message>
        <source>Show alone, and back</source>
        <translation>Allein zeigen und zurück</translation>
    </message>
    <message>
        <source>Double click</source>
        <translation>Doppelklick</translation>
    </message>
    <message>
        <source>Point: its line in the other views</source>
        <translation>Zeigen: Linie in den anderen Ansichten</translation>
    </message>
    <message>
        <source>Shift and move</source>
        <translation>Umschalt und bewegen</translation>
    </message>
    <message>
        <source>Fit</source>
        <translation>Einpassen</translation>
    </message>
    <message>
        <source>Automatic window</source>
        <translation>Automatische Fensterung</translation>
    </message>
    <message>
        <source>Windows for everything, bone, metal</source>
        <translation>Fenster für alles, Knochen, Metall</translation>
    </message>
    <message>
        <source>Invert</source>
        <translation>Umkehren</translation>
    </message>
    <message>
        <source>Mirror</source>
        <translation>Spiegeln</translation>
    </message>
    <message>
        <source>Shortcuts</source>
        <translation>Tastenkürzel</translation>
    </message>
    <message>
        <source>What</source>
        <translation>Was</translation>
    </message>
    <message>
        <source>Keys</source>
        <translation>Tasten</translation>
    </message>
</context>
<context>
    <name>fluorocut::ui::StartPage</name>
    <message>
        <source>Plan the cavity of a new femoral stem in C-arm images, mill it by robot, stage by stage.</source>
        <translation>Die Höhle für einen neuen Femurschaft in C-Bogen-Bildern planen und vom Roboter fräsen lassen, Stufe für Stufe.</translation>
    </message>
    <message>
        <source>Research software, not a medical device.</source>
        <translation>Forschungssoftware, kein Medizinprodukt.</translation>
    </message>
    <message>
        <source>Open the sample case</source>
        <translation>Beispielfall öffnen</translation>
    </message>
    <message>
        <source>A simulated hip with six registered views and a planned stem</source>
        <translation>Eine simulierte Hüfte mit sechs registrierten Ansichten und einem geplanten Schaft</translation>
    </message>
    <message>
        <source>Open files...</source>
        <translation>Dateien öffnen...</translation>
    </message>
    <message>
        <source>Images, a CT, an implant&apos;s mesh, or a saved case</source>
        <translation>Bilder, ein CT, das Netz eines Implantats oder ein gespeicherter Fall</translation>
    </message>
    <message>
        <source>Or drop images, a CT, an implant&apos;s mesh or a saved case anywhere on this window.</source>
        <translation>Oder Bilder, ein CT, das Netz eines Implantats oder einen gespeicherten Fall auf dieses Fenster ziehen.</translation>
    </message>
    <message>
        <source>Recent</source>
        <translation>Zuletzt</translation>
    </message>
</context>
</TS>
