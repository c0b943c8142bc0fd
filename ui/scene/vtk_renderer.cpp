// The OpenGL renderer. Its own pass draws what is translucent: for each thing first its depth alone, then its nearest
// layer over what is there. That is exact for nested things in their order, and needs two passes over the geometry
// where depth peeling takes as many as there are layers.
#include <QCoreApplication>
#include <algorithm>
#include <utility>

#include <vtkActor.h>
#include <vtkAutoInit.h>
#include <vtkCallbackCommand.h>
#include <vtkCamera.h>
#include <vtkCameraPass.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkImageData.h>
#include <vtkInformation.h>
#include <vtkInformationIntegerKey.h>
#include <vtkLight.h>
#include <vtkLightsPass.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>
#include <vtkOpaquePass.h>
#include <vtkOpenGLActor.h>
#include <vtkOpenGLState.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderPassCollection.h>
#include <vtkRenderState.h>
#include <vtkRenderer.h>
#include <vtkRendererCollection.h>
#include <vtkSequencePass.h>
#include <vtkShaderProperty.h>
#include <vtkSmartPointer.h>
#include <vtkTexture.h>
#include <vtkTypeInt32Array.h>
#include <vtkUnsignedCharArray.h>

#include "core/base/units.h"
#include "ui/scene/egl_context.h"
#include "ui/scene/scene_renderer.h"
#include "ui/scene/shading.h"

VTK_MODULE_INIT(vtkRenderingOpenGL2)

namespace fluorocut::ui {
namespace {

class NearestLayerPass : public vtkRenderPass {
  public:
    static NearestLayerPass* New() {
        auto* made = new NearestLayerPass;
        made->InitializeObjectBase();
        return made;
    }

    void Render(const vtkRenderState* state) override {
        vtkRenderer* renderer = state->GetRenderer();
        vtkOpenGLState* gl = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow())->GetState();
        // What lies exactly at the depth that was written just before is what is to be seen.
        const vtkOpenGLState::ScopedglDepthFunc restored(gl);
        constexpr unsigned int kLessOrEqual = 0x0203;  // GL_LEQUAL; VTK draws with GL_LESS
        gl->vtkglDepthFunc(kLessOrEqual);
        for (int i = 0; i < state->GetPropArrayCount(); ++i) {
            vtkProp* prop = state->GetPropArray()[i];
            if (!prop->HasTranslucentPolygonalGeometry()) continue;
            gl->vtkglColorMask(false, false, false, false);
            prop->RenderTranslucentPolygonalGeometry(renderer);
            gl->vtkglColorMask(true, true, true, true);
            prop->RenderTranslucentPolygonalGeometry(renderer);
        }
    }
};

vtkSmartPointer<vtkPoints> pointsOf(const std::vector<Vector3>& vertices) {
    auto points = vtkSmartPointer<vtkPoints>::New();
    points->SetDataTypeToFloat();
    points->SetNumberOfPoints(static_cast<vtkIdType>(vertices.size()));
    for (std::size_t i = 0; i < vertices.size(); ++i)
        points->SetPoint(static_cast<vtkIdType>(i), vertices[i].data());
    return points;
}

template <class Vectors>
vtkSmartPointer<vtkFloatArray> floatsOf(const Vectors& vectors, int components) {
    auto array = vtkSmartPointer<vtkFloatArray>::New();
    array->SetNumberOfComponents(components);
    array->SetNumberOfTuples(static_cast<vtkIdType>(vectors.size()));
    for (std::size_t i = 0; i < vectors.size(); ++i)
        array->SetTuple(static_cast<vtkIdType>(i), vectors[i].data());
    return array;
}

vtkSmartPointer<vtkPolyData> dataOf(const SceneItem& item) {
    auto data = vtkSmartPointer<vtkPolyData>::New();
    vtkNew<vtkCellArray> cells;
    if (item.surface) {
        const ShadedMesh& mesh = *item.surface;
        data->SetPoints(pointsOf(mesh.vertices));
        data->GetPointData()->SetNormals(floatsOf(mesh.normals, 3));
        if (item.picture) {
            // VTK's pictures begin below.
            std::vector<Vector2> upward = item.picture->places;
            for (Vector2& place : upward)
                place.y() = 1 - place.y();
            data->GetPointData()->SetTCoords(floatsOf(upward, 2));
        }
        vtkNew<vtkTypeInt32Array> corners;
        corners->SetNumberOfValues(3 * static_cast<vtkIdType>(mesh.triangles.size()));
        vtkIdType next = 0;
        for (const Triangle& triangle : mesh.triangles)
            for (const std::int32_t corner : triangle)
                corners->SetValue(next++, corner);
        cells->SetData(3, corners);
        data->SetPolys(cells);
    } else if (item.lines) {
        std::vector<Vector3> vertices;
        for (const auto& line : *item.lines) {
            cells->InsertNextCell(static_cast<int>(line.size()));
            for (const Vector3& p : line) {
                cells->InsertCellPoint(static_cast<vtkIdType>(vertices.size()));
                vertices.push_back(p);
            }
        }
        data->SetPoints(pointsOf(vertices));
        data->SetLines(cells);
    }
    return data;
}

vtkSmartPointer<vtkTexture> textureOf(const QImage& picture) {
    const QImage rgb = picture.convertToFormat(QImage::Format_RGB888).mirrored();
    vtkNew<vtkImageData> image;
    image->SetDimensions(rgb.width(), rgb.height(), 1);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
    const auto row_bytes = static_cast<std::size_t>(3 * rgb.width());
    for (int y = 0; y < rgb.height(); ++y)
        std::copy_n(rgb.constScanLine(y), row_bytes, static_cast<uchar*>(image->GetScalarPointer(0, y, 0)));
    auto texture = vtkSmartPointer<vtkTexture>::New();
    texture->SetInputData(image);
    texture->InterpolateOn();
    texture->RepeatOff();
    return texture;
}

void setStyle(vtkActor& actor, const SceneItem& item) {
    vtkProperty* property = actor.GetProperty();
    const bool lit = item.surface && !item.picture;
    const QColor color = item.picture ? QColor(Qt::white) : item.color;
    property->SetColor(color.redF(), color.greenF(), color.blueF());
    property->SetLighting(lit);
    property->SetAmbient(lit ? item.ambient : 1);
    property->SetDiffuse(lit ? 1 - item.ambient : 0);
    property->SetSpecular(item.shine);
    property->SetSpecularColor(1, 1, 1);
    property->SetSpecularPower(kShininess);
    property->SetOpacity(item.opacity);
    property->SetBackfaceCulling(item.one_sided);
    if (item.isOpaque())
        actor.ForceOpaqueOn();
    else
        actor.ForceTranslucentOn();
}

// Opacity between face on and edge on, of which the light's own code knows nothing.
void addRim(vtkActor& actor, const SceneItem& item) {
    if (item.isOpaque() || item.rim_opacity == item.opacity || !item.surface) return;
    const QString code = QStringLiteral("opacity = mix(%1, %2, abs(normalVCVSOutput.z));\n//VTK::Light::Impl\n")
                             .arg(item.rim_opacity, 0, 'f', 6)
                             .arg(item.opacity, 0, 'f', 6);
    actor.GetShaderProperty()->AddFragmentShaderReplacement("//VTK::Light::Impl", true, code.toStdString(), false);
}

void setPlace(vtkActor& actor, const Rigid3& femur_from_item) {
    const Matrix4 matrix = femur_from_item.matrix();
    vtkNew<vtkMatrix4x4> placed;
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            placed->SetElement(row, column, matrix(row, column));
    actor.SetUserMatrix(placed);
}

class VtkRenderer : public SceneRenderer {
  public:
    ~VtkRenderer() override {
        if (!egl_.isValid()) return;
        egl_.makeCurrent();
        drawn_.clear();
        window_->RemoveRenderer(renderer_);
        window_->Finalize();
    }

    // Empty, or why there is no picture to be had.
    QString start() {
        if (!egl_.isValid()) return egl_.error();
        window_->SetOffScreenRendering(1);
        window_->SetMultiSamples(0);
        window_->SetOwnContext(false);
        observe(vtkCommand::WindowMakeCurrentEvent, [](EglContext& egl, void*) { egl.makeCurrent(); });
        observe(vtkCommand::WindowIsCurrentEvent,
                [](EglContext& egl, void* answer) { *static_cast<bool*>(answer) = egl.isCurrent(); });
        observe(vtkCommand::WindowSupportsOpenGLEvent,
                [](EglContext&, void* answer) { *static_cast<int*>(answer) = 1; });
        observe(vtkCommand::WindowIsDirectEvent, [](EglContext&, void* answer) { *static_cast<int*>(answer) = 1; });
        window_->SetReadyForRendering(true);
        window_->OpenGLInit();
        if (!window_->SupportsOpenGL()) {
            return QCoreApplication::translate("SceneRenderer", "OpenGL is older than 3.2");
        }

        vtkNew<vtkLightsPass> lights;
        vtkNew<vtkOpaquePass> opaque;
        vtkNew<NearestLayerPass> translucent;
        vtkNew<vtkRenderPassCollection> passes;
        passes->AddItem(lights);
        passes->AddItem(opaque);
        passes->AddItem(translucent);
        vtkNew<vtkSequencePass> sequence;
        sequence->SetPasses(passes);
        vtkNew<vtkCameraPass> camera;
        camera->SetDelegatePass(sequence);
        renderer_->SetPass(camera);
        renderer_->AutomaticLightCreationOff();
        vtkNew<vtkLight> light;
        light->SetLightTypeToHeadlight();
        renderer_->AddLight(light);
        renderer_->SetBackground(kSceneBelow.redF(), kSceneBelow.greenF(), kSceneBelow.blueF());
        renderer_->SetBackground2(kSceneAbove.redF(), kSceneAbove.greenF(), kSceneAbove.blueF());
        renderer_->GradientBackgroundOn();
        window_->AddRenderer(renderer_);
        return {};
    }

    bool usesOpenGL() const override { return true; }

    QImage render(const std::vector<SceneItem>& items, const SceneCamera& camera, const QSize& size) override {
        if (size.isEmpty()) return {};
        egl_.makeCurrent();
        show(items);
        place(camera, ballAround(items));
        window_->SetSize(size.width(), size.height());
        window_->Render();
        window_->GetRGBACharPixelData(0, 0, size.width() - 1, size.height() - 1, 0, pixels_);
        return QImage(pixels_->GetPointer(0), size.width(), size.height(), QImage::Format_RGBX8888).mirrored();
    }

  private:
    struct Drawn {
        SceneItem item;
        vtkSmartPointer<vtkActor> actor;
    };

    static bool sameStyle(const SceneItem& a, const SceneItem& b) {
        return a.surface == b.surface && a.lines == b.lines && a.picture == b.picture && a.color == b.color &&
               a.opacity == b.opacity && a.rim_opacity == b.rim_opacity && a.shine == b.shine &&
               a.ambient == b.ambient && a.one_sided == b.one_sided;
    }

    void observe(unsigned long event, void (*answer)(EglContext&, void*)) {
        vtkNew<vtkCallbackCommand> command;
        struct Call {
            EglContext* egl;
            void (*answer)(EglContext&, void*);
        };
        command->SetClientData(new Call{&egl_, answer});
        command->SetClientDataDeleteCallback([](void* data) { delete static_cast<Call*>(data); });
        command->SetCallback([](vtkObject*, unsigned long, void* data, void* call) {
            const auto* mine = static_cast<Call*>(data);
            mine->answer(*mine->egl, call);
        });
        window_->AddObserver(event, command);
    }

    // An actor for every item, in their order; those that are shown already only move.
    void show(const std::vector<SceneItem>& items) {
        std::vector<Drawn> next;
        next.reserve(items.size());
        bool same_order = items.size() == drawn_.size();
        for (std::size_t i = 0; i < items.size(); ++i) {
            const auto known = std::find_if(drawn_.begin(), drawn_.end(), [&](const Drawn& drawn) {
                return drawn.actor && sameStyle(drawn.item, items[i]);
            });
            same_order = same_order && known == drawn_.begin() + static_cast<std::ptrdiff_t>(i);
            if (known == drawn_.end()) {
                next.push_back({items[i], actorFor(items[i])});
            } else {
                next.push_back({items[i], std::exchange(known->actor, nullptr)});
            }
            setPlace(*next.back().actor, items[i].femur_from_item);
            next.back().actor->GetProperty()->SetLineWidth(static_cast<float>(items[i].width_px));
        }
        if (!same_order) {
            for (const Drawn& gone : drawn_)
                if (gone.actor) gone.actor->ReleaseGraphicsResources(window_);
            renderer_->RemoveAllViewProps();
            for (const Drawn& drawn : next)
                renderer_->AddActor(drawn.actor);
        }
        drawn_ = std::move(next);
    }

    vtkSmartPointer<vtkActor> actorFor(const SceneItem& item) {
        auto actor = vtkSmartPointer<vtkActor>::New();
        vtkNew<vtkPolyDataMapper> mapper;
        mapper->SetInputData(dataOf(item));
        actor->SetMapper(mapper);
        if (item.picture) actor->SetTexture(textureOf(item.picture->image));
        setStyle(*actor, item);
        addRim(*actor, item);
        // Translucent things write their depth too: that is how only the nearest layer is seen.
        vtkNew<vtkInformation> keys;
        keys->Set(vtkOpenGLActor::GLDepthMaskOverride(), 1);
        actor->SetPropertyKeys(keys);
        return actor;
    }

    void place(const SceneCamera& camera, const SceneBall& ball) {
        vtkCamera* vtk = renderer_->GetActiveCamera();
        const Vector3 position = camera.position(), up = camera.up();
        vtk->SetPosition(position.x(), position.y(), position.z());
        vtk->SetFocalPoint(camera.focus.x(), camera.focus.y(), camera.focus.z());
        vtk->SetViewUp(up.x(), up.y(), up.z());
        vtk->SetViewAngle(degreesFromRadians(camera.view_angle_rad));
        const SceneCamera::Depths depths = camera.depths(ball);
        vtk->SetClippingRange(depths.near_mm, depths.far_mm);
    }

    EglContext egl_;
    vtkNew<vtkGenericOpenGLRenderWindow> window_;
    vtkNew<vtkRenderer> renderer_;
    vtkNew<vtkUnsignedCharArray> pixels_;
    std::vector<Drawn> drawn_;
};

}  // namespace

std::unique_ptr<SceneRenderer> makeOpenGLRenderer(QString* why_not) {
    auto renderer = std::make_unique<VtkRenderer>();
    const QString failure = renderer->start();
    if (failure.isEmpty()) return renderer;
    if (why_not) *why_not = failure;
    return nullptr;
}

}  // namespace fluorocut::ui
