within CascadedTanks.Slots;
model Outlet "Null version: Torricelli's law"
  extends PartialOutlet;
equation
  actual = nominal;
end Outlet;
