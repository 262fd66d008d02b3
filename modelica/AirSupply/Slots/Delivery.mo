within AirSupply.Slots;
model Delivery "Null version: the same mass flow rate at any back pressure"
  extends PartialDelivery;
equation
  actual = nominal;
end Delivery;
