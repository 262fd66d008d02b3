within LeakingChamber.Interfaces;
partial model PartialHeat "Slot: what the temperature of the air does to the pressure"
  input Real pAir(unit="Pa") "Pressure in the chamber, absolute";
  input Real escape(unit="1/s") "Share of the air that leaves within a second";
  output Real rate(unit="Pa/s") "At which the pressure rises, beyond the isothermal law";
end PartialHeat;
