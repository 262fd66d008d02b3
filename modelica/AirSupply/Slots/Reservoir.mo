within AirSupply.Slots;
model Reservoir "Null version: a constant temperature"
  extends PartialReservoir;
equation
  actual = isothermal;
end Reservoir;
