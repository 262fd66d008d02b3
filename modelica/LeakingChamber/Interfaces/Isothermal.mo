within LeakingChamber.Interfaces;
model Isothermal "Null version: the air has the temperature of the walls"
  extends PartialHeat;
equation
  rate = 0.0;
end Isothermal;
