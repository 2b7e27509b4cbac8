// exampleDeepMuon MODEL EVENTS [DEPTH]: muons on a plate of plastic scintillator, 1 m x 1 m x 2 cm.

#include <iostream>
#include <memory>
#include <optional>
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

#include "DeepMuonAction.hh"
#include "Deposits.hh"

class Plate : public G4VUserDetectorConstruction {
    G4VPhysicalVolume* Construct() override {
        auto* nist = G4NistManager::Instance();
        auto* air = nist->FindOrBuildMaterial("G4_AIR");
        auto* plastic = nist->FindOrBuildMaterial("G4_PLASTIC_SC_VINYLTOLUENE");
        auto* world = new G4LogicalVolume(new G4Box("world", 11 * m, 11 * m, 2 * m), air, "world");
        auto* plate = new G4LogicalVolume(new G4Box("plate", 0.5 * m, 0.5 * m, 1 * cm), plastic, "plate");
        new G4PVPlacement(nullptr, {}, plate, "plate", world, false, 0);
        return new G4PVPlacement(nullptr, {}, world, "world", nullptr, false, 0);
    }
};

class Actions : public G4VUserActionInitialization {
public:
    Actions(const std::string& model, std::optional<float> depth) : model_(model), depth_(depth) {}
    void Build() const override {
        SetUserAction(depth_ ? new DeepMuonAction(model_, *depth_, 20 * m, 1 * m)
                             : new DeepMuonAction(model_, 20 * m, 1 * m));
        auto* deposits = new Deposits;
        SetUserAction(deposits);
        SetUserAction(new Steps(*deposits, "plate"));
    }

private:
    std::string model_;
    std::optional<float> depth_; // m, of a family
};

int main(int argc, char** argv) {
    if (argc != 3 && argc != 4) {
        std::cerr << "usage: exampleDeepMuon MODEL EVENTS [DEPTH]\n";
        return 2;
    }
    std::unique_ptr<G4RunManager> manager(G4RunManagerFactory::CreateRunManager(G4RunManagerType::Serial));
    manager->SetUserInitialization(new Plate);
    manager->SetUserInitialization(new FTFP_BERT);
    manager->SetUserInitialization(new Actions(argv[1], argc == 4 ? std::optional(std::stof(argv[3])) : std::nullopt));
    manager->Initialize();
    manager->BeamOn(std::stoi(argv[2]));

    const auto* muons = static_cast<const DeepMuonAction*>(manager->GetUserPrimaryGeneratorAction());
    const G4double time = muons->LiveTime(std::stod(argv[2]));
    std::cout << Deposits::hits << " hits in " << time / s << " s, " << Deposits::hits / (time / s) << " per second, "
              << Deposits::sum / Deposits::hits / MeV << " MeV each\n";
}
