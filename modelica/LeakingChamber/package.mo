package LeakingChamber "A chamber that was filled with air and closed"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>What the pressure of a closed chamber tells of its leaks. Nothing drives it: the pressure at the
start does.</p>
</html>"));
end LeakingChamber;
