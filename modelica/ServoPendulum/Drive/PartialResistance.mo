within ServoPendulum.Drive;
partial model PartialResistance "Slot: what the current has to overcome"
  input Real u(unit="Ohm") "Nominal value";
  input Real duty(unit="1") "Share of time in which the bridge is on, with the sign of the voltage";
  input Real current(unit="A") "Of the winding";
  output Real y(unit="Ohm") "Value that acts";
end PartialResistance;
