within AirSupply.Slots;
partial model PartialReservoir "Slot: how else than by its mass the pressure of the air changes"
  input Real isothermal(unit="Pa/s") "Rate of the pressure at a constant temperature";
  input Real p(unit="Pa") "Pressure, absolute";
  output Real actual(unit="Pa/s") "Rate of the pressure";
end PartialReservoir;
