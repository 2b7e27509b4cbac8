// exampleBox SOURCE EVENTS: muons that hit a box of water, 4 m x 4 m x 3 m, from a model or from an MCPL file.

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>

#include "FTFP_BERT.hh"
#include "G4Box.hh"
#include "G4LogicalVolume.hh"
#include "G4NistManager.hh"
#include "G4PVPlacement.hh"
#include "G4RunManager.hh"
#include "G4RunManagerFactory.hh"
#include "G4SystemOfUnits.hh"
#include "G4VUserActionInitialization.hh"
#include "G4VUserDetectorConstruction.hh"

#include "BoxAction.hh"
#include "Deposits.hh"
#include "McplAction.hh"

constexpr G4double x = 4 * m, y = 4 * m, z = 3 * m;

class Tank : public G4VUserDetectorConstruction {
    G4VPhysicalVolume* Construct() override {
        auto* nist = G4NistManager::Instance();
        auto* air = nist->FindOrBuildMaterial("G4_AIR");
        auto* water = nist->FindOrBuildMaterial("G4_WATER");
        auto* world = new G4LogicalVolume(new G4Box("world", x, y, z), air, "world");
        auto* tank = new G4LogicalVolume(new G4Box("tank", x / 2, y / 2, z / 2), water, "tank");
        new G4PVPlacement(nullptr, {}, tank, "tank", world, false, 0);
        return new G4PVPlacement(nullptr, {}, world, "world", nullptr, false, 0);
    }
};

class Actions : public G4VUserActionInitialization {
public:
    explicit Actions(const std::string& source) : source_(source) {}
    void Build() const override {
        if (source_.find(".mcpl") != std::string::npos) {
            SetUserAction(new McplAction(source_));
        } else {
            SetUserAction(new BoxAction(source_, x, y, z));
        }
        auto* deposits = new Deposits;
        SetUserAction(deposits);
        SetUserAction(new Steps(*deposits, "tank"));
    }

private:
    std::string source_;
};

int main(int argc, char** argv) {
    if (argc != 3) {
        std::cerr << "usage: exampleBox SOURCE EVENTS\n";
        return 2;
    }
    std::unique_ptr<G4RunManager> manager(G4RunManagerFactory::CreateRunManager(G4RunManagerType::Serial));
    manager->SetUserInitialization(new Tank);
    manager->SetUserInitialization(new FTFP_BERT);
    manager->SetUserInitialization(new Actions(argv[1]));
    manager->Initialize();
    manager->BeamOn(std::stoi(argv[2]));

    const auto* action = manager->GetUserPrimaryGeneratorAction();
    G4double time = 0;
    if (const auto* model = dynamic_cast<const BoxAction*>(action)) {
        time = model->LiveTime();
    } else if (const auto* file = dynamic_cast<const McplAction*>(action)) {
        time = file->LiveTime() * std::min(1.0, std::stod(argv[2]) / file->Muons());
    }
    std::cout << Deposits::hits << " hits in " << time / s << " s, " << Deposits::hits / (time / s) << " per second, "
              << Deposits::sum / Deposits::hits / MeV << " MeV each\n";
}
