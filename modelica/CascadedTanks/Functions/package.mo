within CascadedTanks;
package Functions "Laws"
end Functions;
